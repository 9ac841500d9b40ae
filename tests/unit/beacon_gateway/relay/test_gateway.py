"""A gateway that relays beside all else it does."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from beacon_core.clock import SystemClock
from beacon_core.errors import ConfigError
from beacon_fake import FakeNetwork, share_network, unshare_network
from beacon_gateway import adapters, cli
from beacon_gateway.config import parse_config
from beacon_gateway.console.exits import Exit
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.relay.routes import RELAY_PATH
from beacon_gateway.server import HttpServer
from tests.unit.beacon_gateway.relay.plant import Plant, wait_for


@pytest.fixture
def document(
    plant: Plant, one_way: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[dict[str, Any]]:
    share_network(FakeNetwork(SystemClock()), str(tmp_path))
    monkeypatch.setattr(adapters, "entry_points", plant.entry_points)
    yield {
        "sources": {"test": {"adapter": "fake", "options": {"network": str(tmp_path)}}},
        "relay": {"ends": one_way, "state_folder": str(tmp_path)},
    }
    unshare_network(str(tmp_path))


def test_it_serves_the_relays_report_and_numbers_as_its_own(
    plant: Plant, document: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")
    gateway = Gateway(parse_config(document).config)
    with closing(gateway), closing(HttpServer("127.0.0.1", 0)) as server:
        gateway.start()
        assert gateway.relay is not None
        ends = gateway.relay.ends
        thread = threading.Thread(target=server.serve, args=(create_app(gateway),))
        thread.start()
        wait_for(lambda: bool(ends["site"].state().lanes), "the route")
        talker.publish(b"x")
        wait_for(lambda: heard.received() == [b"x"])
        told = httpx.get(server.url + RELAY_PATH).json()
        assert [one["name"] for one in told["ends"]] == ["robot", "site"]
        assert 'beacon_relay_link_up{end="robot"} 1.0' in httpx.get(f"{server.url}/metrics").text
        assert cli.main(["relay", "explain", "/chatter", "--url", server.url]) == Exit.OK
        assert "renamed to /robot/chatter" in capsys.readouterr().out
        server.stop()
        thread.join(5)
    gateway.close()
    late = plant.subscription("site", "/robot/chatter")
    talker.publish(b"y")
    assert late.received() == []


def test_without_a_relay_it_says_so(
    document: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    del document["relay"]
    gateway = Gateway(parse_config(document).config)
    with closing(gateway), closing(HttpServer("127.0.0.1", 0)) as server:
        gateway.start()
        thread = threading.Thread(target=server.serve, args=(create_app(gateway),))
        thread.start()
        assert cli.main(["relay", "status", "--url", server.url]) == Exit.FAILED
        assert "runs no relay; name one with --url" in capsys.readouterr().err
        server.stop()
        thread.join(5)


def test_what_is_wrong_with_the_relay_is_told_with_its_place(document: dict[str, Any]) -> None:
    del document["relay"]["ends"]["site"]["republish"]
    with pytest.raises(ConfigError, match=r"\$\.relay\.ends\.site: this end does nothing"):
        parse_config(document)


def test_its_ends_are_others_than_those_of_a_gateway_elsewhere(
    document: dict[str, Any], tmp_path: Path
) -> None:
    here, there = (
        parse_config(document, folder=tmp_path / name).config.relay for name in ("a", "b")
    )
    assert here is not None
    assert there is not None
    assert here.identity != there.identity
