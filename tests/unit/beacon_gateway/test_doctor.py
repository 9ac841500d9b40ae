"""``beacon doctor``, against adapters that find what they are told, and gateways that run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest

from beacon_core.ports.adapter import Adapter
from beacon_core.ports.examination import Finding, Level
from beacon_fake import ADAPTER as FAKE
from beacon_gateway import adapters, cli
from beacon_gateway.server import HttpServer, free_port

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant

Capture = pytest.CaptureFixture[str]
Serve = Callable[["Plant"], str]

WELL = Finding(Level.OK, "all is well")
NOTED = Finding(Level.NOTE, "somebody else is there too", "perhaps it is meant so")
NOBODY = Finding(Level.PROBLEM, "nobody is there", "switch it on")
STRANGE = Finding(Level.PROBLEM, "here is \x1b[31m[bold]evil", "\x07 away")


@attrs.frozen
class Options:
    pass


class Source:
    def close(self) -> None:
        pass


class Point:
    """Stands in for an entry point."""

    def __init__(self, adapter: Adapter) -> None:
        self._adapter = adapter

    def load(self) -> Adapter:
        return self._adapter


@pytest.fixture
def finding(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., Path]:
    """Installs adapters that find these things; returns a configuration with a source of each."""

    def install(*groups: list[Finding], port: int | None = None, more: str = "") -> Path:
        def adapter(name: str, group: list[Finding]) -> Adapter:
            source: Any = lambda _: Source()  # noqa: E731
            return attrs.evolve(
                FAKE, name=name, options=Options, source=source, examine=lambda *_: iter(group)
            )

        points = {f"a{n}": Point(adapter(f"a{n}", group)) for n, group in enumerate(groups)}
        monkeypatch.setattr(adapters, "installed", lambda *_: points)
        sources = ", ".join(f"s{n}: {{adapter: {name}}}" for n, name in enumerate(points))
        path = tmp_path / "gateway.yaml"
        path.write_text(f"http: {{port: {port or free_port()}}}\nsources: {{{sources}}}\n{more}\n")
        return path

    return install


def doctor(*arguments: str | Path) -> int:
    return cli.main(["doctor", *map(str, arguments)])


def test_each_source_is_shown_with_marks_and_advice_and_then_the_gateway(
    finding: Callable[..., Path], capsys: Capture
) -> None:
    port = free_port()
    assert doctor("-c", finding([WELL, NOBODY], [NOTED], port=port)) == 1
    captured = capsys.readouterr()
    assert captured.err == ""
    assert captured.out == (
        "s0 (a0)\n"
        "  ok       all is well\n"
        "  problem  nobody is there\n"
        "           switch it on\n"
        "\n"
        "s1 (a1)\n"
        "  note     somebody else is there too\n"
        "           perhaps it is meant so\n"
        "\n"
        f"gateway at http://127.0.0.1:{port}\n"
        f"  note     no gateway answers at http://127.0.0.1:{port}\n"
        "           start one with 'beacon run', or name another with --url\n"
        "\n"
        "One problem was found: nobody is there.\n"
    )


def test_without_a_problem_the_exit_code_says_so_too(
    finding: Callable[..., Path], capsys: Capture
) -> None:
    assert doctor("-c", finding([WELL], [NOTED])) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "Nothing was found that keeps hints from being heard."


def test_of_several_problems_the_first_is_the_one_to_begin_with(
    finding: Callable[..., Path], capsys: Capture
) -> None:
    assert doctor("-c", finding([NOBODY], [STRANGE])) == 1
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "2 problems were found; the first: nobody is there."


def test_json_says_the_same(finding: Callable[..., Path], capsys: Capture) -> None:
    port = free_port()
    assert doctor("--json", "-c", finding([WELL, NOBODY], [NOTED], port=port)) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] is False
    assert document["verdict"] == "One problem was found: nobody is there."
    assert document["sources"] == [
        {
            "name": "s0",
            "adapter": "a0",
            "findings": [
                {"level": "ok", "what": "all is well", "advice": ""},
                {"level": "problem", "what": "nobody is there", "advice": "switch it on"},
            ],
        },
        {
            "name": "s1",
            "adapter": "a1",
            "findings": [{"level": "note", "what": NOTED.what, "advice": NOTED.advice}],
        },
    ]
    assert document["gateway"]["url"] == f"http://127.0.0.1:{port}"
    assert document["gateway"]["findings"][0]["level"] == "note"
    assert doctor("--json", "-c", finding([WELL])) == 0
    assert json.loads(capsys.readouterr().out)["ok"] is True


def test_what_strangers_say_does_not_reach_the_terminal_raw(
    finding: Callable[..., Path], capsys: Capture
) -> None:
    path = finding([STRANGE])
    for arguments in ((), ("--json",)):
        doctor("-c", path, *arguments)
        shown = capsys.readouterr().out
        assert all(char.isprintable() or char == "\n" for char in shown)
        assert "[bold]evil" in shown


def test_a_long_line_stays_one_line(finding: Callable[..., Path], capsys: Capture) -> None:
    long = Finding(Level.NOTE, "word " * 100 + "end")
    doctor("-c", finding([long]))
    assert f"  note     {long.what}" in capsys.readouterr().out.splitlines()


def test_the_adapters_are_told_how_long_to_look(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    looked: list[float] = []

    def examine(_: object, seconds: float) -> Iterator[Finding]:
        looked.append(seconds)
        yield WELL

    source: Any = lambda _: Source()  # noqa: E731
    zenoh = attrs.evolve(adapters.load_adapter("zenoh"), source=source, examine=examine)
    monkeypatch.setattr(adapters, "installed", lambda *_: {"zenoh": Point(zenoh)})
    url = f"127.0.0.1:{free_port()}"
    assert doctor("--url", url) == 0
    assert doctor("--url", url, "--seconds", "0.5") == 0
    assert looked == [5.0, 0.5]
    # Without a file it is the default configuration that is looked at.
    assert capsys.readouterr().out.splitlines()[0] == "zenoh (zenoh)"


# The configuration


def test_a_wrong_configuration_is_told_as_by_check_config(
    finding: Callable[..., Path], capsys: Capture
) -> None:
    path = finding([WELL], more="log_level: loud")
    assert doctor("-c", path) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"beacon: {path}: 1 problem",
        "  $.log_level: found the text 'loud'; give one of debug, info, warning, error",
    ]
    assert doctor("--json", "-c", path) == 2
    shown = capsys.readouterr().out
    assert cli.main(["check-config", str(path), "--json"]) == 2
    assert capsys.readouterr().out == shown


def test_what_was_put_right_in_it_is_said(finding: Callable[..., Path], capsys: Capture) -> None:
    path = finding([WELL])
    path.write_text(path.read_text().replace("{adapter: a0}", "{adapter: a0, ttl_s: 0}"))
    assert doctor("-c", path) == 0
    said = capsys.readouterr().err
    assert said == "warning: $.sources.s0.ttl_s: 0.0 is too small; using 0.1\n"


# A gateway that runs


def test_a_running_gateway_is_asked_what_it_counts(
    finding: Callable[..., Path], plant: Plant, serve: Serve, capsys: Capture
) -> None:
    plant.announce("a")
    url = serve(plant)
    path = finding([WELL], port=int(url.rpartition(":")[2]))
    assert doctor("-c", path) == 0
    shown = capsys.readouterr().out
    assert f"gateway at {url}\n  note     s0: the running gateway has no such source\n" in shown
    assert "  ok       robots: 1 sender; 1 active, 0 stale, 0 left\n" in shown


def test_what_is_turned_away_while_the_doctor_looks_is_a_problem(
    monkeypatch: pytest.MonkeyPatch,
    finding: Callable[..., Path],
    plant: Plant,
    serve: Serve,
    capsys: Capture,
) -> None:
    plant.announce("a")

    def meanwhile(*_: object) -> Iterator[Finding]:
        plant.gateway.listeners[0].intake.offer(b"nonsense", "somebody")
        yield WELL

    path = finding([WELL])
    point = adapters.installed()["a0"]
    adapter = attrs.evolve(point.load(), examine=meanwhile)
    monkeypatch.setattr(adapters, "installed", lambda *_: {"a0": Point(adapter)})
    assert doctor("-c", path, "--url", serve(plant)) == 1
    assert "1 message rejected: no hint in this carrier's format, 1 of them just now" in (
        capsys.readouterr().out
    )


def test_that_only_configured_entities_are_shown_is_said(
    finding: Callable[..., Path], plant: Plant, serve: Serve, capsys: Capture
) -> None:
    plant.announce("a")
    path = finding([WELL], more="allow_new_entities: false")
    assert doctor("-c", path, "--url", serve(plant)) == 0
    assert "allow_new_entities is false" in capsys.readouterr().out
    assert doctor("-c", finding([WELL]), "--url", f"127.0.0.1:{free_port()}") == 0
    assert "allow_new_entities" not in capsys.readouterr().out


@pytest.mark.parametrize("host", ["0.0.0.0", '""'])  # noqa: S104 - nothing is opened
def test_a_gateway_that_serves_everywhere_is_asked_here(
    finding: Callable[..., Path], plant: Plant, serve: Serve, capsys: Capture, host: str
) -> None:
    plant.announce("a")
    url = serve(plant)
    path = finding([WELL], port=int(url.rpartition(":")[2]))
    path.write_text(path.read_text().replace("http: {", f"http: {{host: {host}, "))
    assert doctor("-c", path) == 0
    assert f"gateway at {url}\n" in capsys.readouterr().out


def test_an_address_of_six_is_written_as_one(finding: Callable[..., Path], capsys: Capture) -> None:
    path = finding([WELL], port=9)
    path.write_text(path.read_text().replace("http: {", 'http: {host: "::", '))
    doctor("-c", path)
    assert "gateway at http://[::1]:9\n" in capsys.readouterr().out


def test_something_else_at_the_gateways_address_is_a_problem(
    finding: Callable[..., Path],
    plant: Plant,
    serve: Serve,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert doctor("-c", finding([WELL]), "--url", f"{serve(plant)}/elsewhere") == 1
    assert "is no beacon gateway" in capsys.readouterr().out
    monkeypatch.setattr("beacon_gateway.console.client._TIMEOUT_S", 0.1)
    with closing(HttpServer("127.0.0.1", 0)) as server:
        # It takes connections and never answers.
        port = int(server.url.rpartition(":")[2])
        assert doctor("-c", finding([WELL], port=port)) == 1
    assert "did not answer within" in capsys.readouterr().out


def test_what_is_no_address_is_wrong_usage(finding: Callable[..., Path], capsys: Capture) -> None:
    assert doctor("-c", finding([WELL]), "--url", "http://[::1") == 2
    assert "not an address" in capsys.readouterr().err
