"""``beacon relay``, as people type it."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from starlette.applications import Starlette

from beacon_gateway import adapters, cli
from beacon_gateway.commands import relay as command
from beacon_gateway.console.exits import Exit
from beacon_gateway.relay.relay import Relay
from beacon_gateway.server import HttpServer, free_port
from tests.unit.beacon_gateway.relay.plant import Plant, end, wait_for

Capture = pytest.CaptureFixture[str]


def relay(*arguments: str | Path) -> int:
    return cli.main(["relay", *map(str, arguments)])


def test_the_status_shows_both_ends_their_books_and_what_is_refused(
    served: tuple[Relay, str], capsys: Capture
) -> None:
    assert relay("status", "--url", served[1]) == Exit.OK
    out = capsys.readouterr().out
    assert "link up" in out
    assert "forward: 3 messages" in out
    assert "republish: 3 messages, 3 delivered" in out
    assert "/robot/chatter" in out
    assert "denied by rule 0: /secret" in out


def test_the_status_as_json_is_what_is_served(served: tuple[Relay, str], capsys: Capture) -> None:
    assert relay("status", "--url", served[1], "--json") == Exit.OK
    assert [one["name"] for one in json.loads(capsys.readouterr().out)["ends"]] == ["robot", "site"]


def test_a_status_that_is_watched_also_has_rates(
    served: tuple[Relay, str], capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = 0

    def sleep(_: float) -> None:
        nonlocal seen
        seen += 1
        if seen > 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(command, "sleep", sleep)
    assert relay("status", "--url", served[1], "--watch", "0.1") == Exit.OK
    assert "0.0/s" in capsys.readouterr().out


def test_a_topic_is_explained_and_the_exit_code_tells_whether_it_is_carried(
    served: tuple[Relay, str], capsys: Capture
) -> None:
    assert relay("explain", "/chatter", "--url", served[1]) == Exit.OK
    assert "allowed by rule 1: /**, renamed to /robot/chatter" in capsys.readouterr().out
    assert relay("explain", "/secret", "--url", served[1]) == Exit.NOT_FOUND
    assert "denied by rule 0: /secret" in capsys.readouterr().out
    assert relay("explain", "/nobody", "--url", served[1]) == Exit.NOT_FOUND
    assert "nobody publishes it on this network" in capsys.readouterr().out


def test_where_no_relay_is_people_are_told_what_to_do(capsys: Capture) -> None:
    assert relay("status", "--url", f"http://127.0.0.1:{free_port()}") == Exit.FAILED
    assert "no gateway answers" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("run",), "-c: give the relay's configuration"),
        (("explain",), "explain: give the topic"),
        (("trace",), "trace: give the file"),
        (("replay",), "replay: give the file"),
    ],
)
def test_what_is_missing_is_asked_for(
    arguments: tuple[str, ...], told: str, capsys: Capture
) -> None:
    assert relay(*arguments) == Exit.USAGE
    assert told in capsys.readouterr().err


@pytest.fixture
def written(
    plant: Plant, one_way: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """A configuration in a file, with the tests' own networks."""
    monkeypatch.setattr(adapters, "entry_points", plant.entry_points)
    path = tmp_path / "relay.yaml"
    document = {"ends": one_way, "http": {"port": 0}, "state_folder": str(tmp_path / "state")}
    path.write_text(yaml.safe_dump(document))
    return path


def test_a_configuration_is_checked_without_starting_anything(
    written: Path, capsys: Capture
) -> None:
    assert relay("check", "-c", written) == Exit.OK
    assert "ok, 2 ends" in capsys.readouterr().out
    assert relay("check", "-c", written, "--json") == Exit.OK
    assert json.loads(capsys.readouterr().out) == {"ok": True, "ends": ["robot", "site"]}


def test_a_configuration_with_a_loop_is_refused(
    written: Path, plant: Plant, link: str, capsys: Capture
) -> None:
    ends = {name: end(name, link, forward=[{"allow": "/**"}], republish=True) for name in "ab"}
    written.write_text(yaml.safe_dump({"ends": ends}))
    assert relay("check", "-c", written) == Exit.USAGE
    assert "a message could go round in circles" in capsys.readouterr().err


def test_a_run_is_traced_and_replayed(
    written: Path, plant: Plant, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop: list[HttpServer] = []
    serve = HttpServer.serve

    def noted(server: HttpServer, app: Starlette) -> None:
        stop.append(server)
        serve(server, app)

    monkeypatch.setattr(HttpServer, "serve", noted)
    trace = tmp_path / "relay.trace"
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")

    def use() -> None:
        wait_for(lambda: stop != [], "serving")
        deadline = time.monotonic() + 10
        while not heard.received() and time.monotonic() < deadline:
            talker.publish(b"x")
            time.sleep(0.05)
        stop[0].stop()

    user = threading.Thread(target=use)
    user.start()
    assert relay("run", "-c", written, "--trace", trace, "--json") == Exit.OK
    user.join(15)
    assert heard.received()
    assert json.loads(capsys.readouterr().out)["url"].startswith("http://127.0.0.1:")
    assert relay("replay", trace) == Exit.OK
    assert "all as recorded" in capsys.readouterr().out
    assert relay("trace", trace) == Exit.OK
    told = capsys.readouterr().out
    assert "site republisher frame content 1#0 1 B" in told
    assert "Publish 1 1 B" in told
    assert "robot forwarder topic_seen /chatter std_msgs/msg/String" in told
    lines = trace.read_text().splitlines()
    trace.write_text("\n".join(lines).replace('"call":"link_up"', '"call":"link_down"', 1))
    assert relay("replay", trace) == Exit.FAILED
    assert "UNLIKE what was recorded" in capsys.readouterr().out
    assert relay("replay", trace, "--json") == Exit.FAILED
    assert json.loads(capsys.readouterr().out)["unlike"]
