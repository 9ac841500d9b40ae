"""The subcommands, against a gateway on simulated carriers, over real HTTP."""

from __future__ import annotations

import io
import json
import logging
import os
import pty
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest
import yaml
from rich.text import Text

from beacon_core.clock import ManualClock
from beacon_core.ports.health import Condition, Health
from beacon_fake import FakeNetwork, FakeSource, share_network, unshare_network
from beacon_gateway import cli
from beacon_gateway.commands import announce as announce_command
from beacon_gateway.config import parse_config
from beacon_gateway.console import robot
from beacon_gateway.console.client import GatewayClient
from beacon_gateway.console.fleet import Fleet, Step, script
from beacon_gateway.console.table import by_attention, entity_table
from beacon_gateway.console.terminal import duration
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer, free_port

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

Capture = pytest.CaptureFixture[str]
Serve = Callable[["Plant"], str]

KNOWN: dict[str, Any] = {"components": [{"id": "ecu"}], "apps": [{"id": "quiet"}]}


def beacon(*arguments: str | Path) -> int:
    """Run the command; usage errors of argparse are exit codes too."""
    try:
        return cli.main([str(argument) for argument in arguments])
    except SystemExit as end:
        return int(end.code or 0)


def eventually(true: Callable[[], bool], within_s: float = 10.0) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.01)


def nowhere() -> str:
    return f"http://127.0.0.1:{free_port()}"


@pytest.fixture
def busy(make_plant: PlantMaker, serve: Serve) -> tuple[Plant, str]:
    """A gateway that knows one entity in each state; and its address."""
    plant = make_plant(entities=KNOWN)
    plant.announce("silent")
    plant.wait(11)
    plant.announce("torn", hostname="one")
    plant.announce("torn", hostname="two", process_id=2, process_name="p")
    plant.announce("left", hostname="h").close()
    plant.announce("again", process_id=1).close()
    plant.announce("again", process_id=2)
    plant.announce("ecu", hostname="ecu.example")
    plant.announce("well", display_name="Well", component_id="ecu", process_name="p")
    plant.settle()
    return plant, serve(plant)


ORDER = ["torn", "silent", "left", "again", "ecu", "well", "quiet"]


# get


def fields(shown: str) -> dict[str, str]:
    return {
        key: value.strip() for key, value in (row.split(maxsplit=1) for row in shown.splitlines())
    }


def test_get_lists_what_needs_attention_first(busy: tuple[Plant, str], capsys: Capture) -> None:
    assert beacon("get", "--url", busy[1]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == (
        ["ENTITY", "STATUS", "AGE", "NAME", "COMPONENT", "PROCESS", "SOURCE", "NOTE"]
    )
    assert [line.split()[0] for line in lines[1:]] == ORDER
    assert [line.split()[1] for line in lines[1:]] == [
        "conflict",
        "stale",
        "left",
        "active",
        "active",
        "active",
        "-",
    ]
    assert "two claim this id (active)" in lines[1]
    assert "silent" in lines[2]
    assert "1 restart" in lines[4]
    assert "p[2]@two" in lines[1] or "@one" in lines[1]
    assert "Well" in lines[6]
    assert "ecu" in lines[6]


def test_get_json_is_a_list_in_the_same_order(busy: tuple[Plant, str], capsys: Capture) -> None:
    assert beacon("get", "--json", "--url", busy[1]) == 0
    assert [item["id"] for item in json.loads(capsys.readouterr().out)] == ORDER


@pytest.mark.parametrize("entity_id", ["well", "ecu"])
def test_get_shows_one_app_or_component(
    busy: tuple[Plant, str], capsys: Capture, entity_id: str
) -> None:
    assert beacon("get", entity_id, "--url", busy[1]) == 0
    shown = fields(capsys.readouterr().out)
    assert shown["entity_id"] == entity_id
    assert shown["status"] == "active"
    assert shown["sources"] == "robots: active"
    assert "stable_id" not in shown


def test_get_shows_every_kind_of_field(plant: Plant, serve: Serve, capsys: Capture) -> None:
    announcer = plant.announce("full", hostname="one")
    plant.networks["robots"].crash(announcer.name)
    plant.wait(1)
    said: dict[str, Any] = {"metadata": {"firmware": "1.2"}, "depends_on": ("a", "b")}
    plant.announce("full", hostname="one", process_id=1, **said)
    plant.announce("full", hostname="two", process_id=2, process_name="p")
    assert beacon("get", "full", "--url", serve(plant)) == 0
    shown = fields(capsys.readouterr().out)
    assert shown["metadata"] == "firmware=1.2"
    assert shown["depends_on"] == "a, b"
    assert shown["conflict"] == "True"
    assert "p[2]@two" in shown["claims"]
    assert "stale (lost)" in shown["history"]
    assert shown["age_sec"].endswith(" s")


def test_get_json_of_one_is_what_the_gateway_says(busy: tuple[Plant, str], capsys: Capture) -> None:
    plant, url = busy
    assert beacon("get", "well", "--json", "--url", url) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown == plant.ok("/apps/well/x-medkit-beacon")


@pytest.mark.parametrize(
    ("entity_id", "message"),
    [
        ("nobody", "no entity nobody; 'beacon get' lists those there are"),
        ("left", "left left 0.0 s ago, with a goodbye"),
        ("quiet", "quiet is known, but nothing has been heard of it"),
    ],
)
def test_get_of_what_is_not_there_is_a_sentence_and_exit_code_3(
    busy: tuple[Plant, str], capsys: Capture, entity_id: str, message: str
) -> None:
    assert beacon("get", entity_id, "--url", busy[1]) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == f"beacon: {message}\n"
    assert beacon("get", entity_id, "--json", "--url", busy[1]) == 3
    captured = capsys.readouterr()
    assert json.loads(captured.out)["error_code"] in ("vendor-error", "entity-not-found")
    assert captured.err == ""


@pytest.mark.parametrize(
    ("entity_id", "said"),
    [
        ("a b", "a b: Entity ID contains invalid character: ' '. "),
        ("\x1b[31m", "\\x1b[31m: Entity ID contains invalid character: '0x1b'. "),
        ("a/b", "a/b: Resource not found"),
    ],
)
def test_get_of_what_can_be_no_id_is_wrong_usage(
    busy: tuple[Plant, str], capsys: Capture, entity_id: str, said: str
) -> None:
    assert beacon("get", entity_id, "--url", busy[1]) == 2
    assert capsys.readouterr().err.startswith(f"beacon: {said}")


def test_what_robots_say_does_not_reach_the_terminal_raw(
    plant: Plant, serve: Serve, capsys: Capture
) -> None:
    plant.announce(
        "odd", display_name="[red]\x1b]0;pwned\x07\u202e", metadata={"k": "\x9b31m\U000e0001"}
    )
    url = serve(plant)
    for arguments in (("get",), ("get", "odd"), ("get", "--json"), ("get", "odd", "--json")):
        assert beacon(*arguments, "--url", url) == 0
        shown = capsys.readouterr().out
        assert all(char.isprintable() or char == "\n" for char in shown)
        assert "[red]" in shown
        if "--json" in arguments:
            assert "[red]\x1b]0;pwned\x07\u202e" in json.dumps(
                json.loads(shown), ensure_ascii=False
            ).replace("\\u001b", "\x1b").replace("\\u0007", "\x07")


# Addresses


@pytest.mark.parametrize("command", [("get",), ("get", "a"), ("watch",), ("watch", "--once")])
def test_without_a_gateway_one_sentence_says_what_to_do(
    capsys: Capture, command: tuple[str, ...]
) -> None:
    url = nowhere()
    assert beacon(*command, "--url", url) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == (
        f"beacon: no gateway answers at {url}; "
        "start one with 'beacon run', or name another with --url\n"
    )


def test_the_scheme_and_the_path_of_the_address_may_be_left_out_or_given(
    busy: tuple[Plant, str], capsys: Capture
) -> None:
    url = busy[1]
    for spelling in (url, f"{url}/", f"{url}/api/v1", url.removeprefix("http://")):
        assert beacon("get", "well", "--url", spelling) == 0
    capsys.readouterr()


@pytest.mark.parametrize("url", ["http://[::1", "http://a b", "ftp://127.0.0.1", "http://"])
def test_what_is_no_address_is_a_sentence(capsys: Capture, url: str) -> None:
    assert beacon("get", "--url", url) in (1, 2)
    assert "Traceback" not in capsys.readouterr().err


class Stranger:
    """Answers every connection with the same bytes."""

    def __init__(self, answer: bytes) -> None:
        self._answer = answer
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with connection:
                connection.recv(65536)
                connection.sendall(self._answer)

    def close(self) -> None:
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()


def test_a_defect_of_the_gateway_is_a_failure(capsys: Capture) -> None:
    body = b'{"message":"went \\u001boff"}'
    answer = b"HTTP/1.1 500 Oh\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body)
    with closing(Stranger(answer)) as stranger:
        assert beacon("get", "a", "--url", stranger.url) == 1
    assert capsys.readouterr().err == "beacon: a: went \\x1boff\n"


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nhi", "is no beacon gateway (HTTP 200"),
        (b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n[]", "is no beacon gateway (HTTP 200"),
        (b"HTTP/1.1 500 Oh\r\nContent-Length: 2\r\n\r\n{}", "answered 500 for /api/v1/apps"),
        (b"SSH-2.0-nonsense\r\n", "no gateway answers at"),
    ],
)
def test_somebody_else_at_that_address_is_a_sentence(
    capsys: Capture, answer: bytes, said: str
) -> None:
    with closing(Stranger(answer)) as stranger:
        assert beacon("get", "--url", stranger.url) == 1
    captured = capsys.readouterr().err
    assert said in captured
    assert captured.count("\n") == 1


def test_an_answer_that_does_not_come_is_a_sentence(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_gateway.console.client._TIMEOUT_S", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        assert beacon("get", "--url", f"127.0.0.1:{silent.getsockname()[1]}") == 1
    assert "did not answer within" in capsys.readouterr().err


# watch


def test_watch_once_shows_the_table_and_the_sum(busy: tuple[Plant, str], capsys: Capture) -> None:
    assert beacon("watch", "--once", "--url", busy[1]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:-1]] == ORDER
    assert lines[-1] == "1 conflict · 1 stale · 1 left · 3 active · 1 without a beacon"


def test_watch_once_json_is_one_line(busy: tuple[Plant, str], capsys: Capture) -> None:
    assert beacon("watch", "--once", "--json", "--url", busy[1]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert [item["id"] for item in json.loads(line)] == ORDER


def test_watch_of_an_empty_gateway_says_so(plant: Plant, serve: Serve, capsys: Capture) -> None:
    assert beacon("watch", "--once", "--url", serve(plant)) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "nothing heard yet"


class Interrupt:
    """Sleeps as ``time.sleep``; does something each time, and in the end it is Ctrl-C."""

    def __init__(self, *between: Callable[[], object]) -> None:
        self._between = iter(between)

    def __call__(self, _: float) -> None:
        do = next(self._between, None)
        if do is None:
            raise KeyboardInterrupt
        do()


def watching(monkeypatch: pytest.MonkeyPatch, *between: Callable[[], object]) -> None:
    monkeypatch.setattr("beacon_gateway.commands.watch.sleep", Interrupt(*between))


def test_watch_goes_on_until_ctrl_c_which_is_its_orderly_end(
    plant: Plant, serve: Serve, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    watching(monkeypatch, lambda: plant.announce("late"))
    assert beacon("watch", "--json", "--url", serve(plant)) == 0
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert first == []
    assert [item["id"] for item in second] == ["late"]


def test_watch_survives_a_restart_of_the_gateway(
    make_plant: PlantMaker, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant = make_plant()
    plant.announce("robot")
    port = free_port()
    servers: list[HttpServer] = []

    def start() -> None:
        server = HttpServer("127.0.0.1", port)
        servers.append(server)
        threading.Thread(target=server.serve, args=(create_app(plant.gateway),)).start()

    def stop() -> None:
        servers[-1].stop()
        eventually(lambda: not _answers(port))
        servers[-1].close()

    def nothing() -> None:
        pass

    start()
    try:
        watching(monkeypatch, stop, nothing, start, nothing)
        assert beacon("watch", "--url", f"http://127.0.0.1:{port}") == 0
    finally:
        stop()
    frames = capsys.readouterr().out.split(f"http://127.0.0.1:{port}")[1:]
    assert ["does not answer" in frame for frame in frames] == [False, True, True, False, False]
    assert all("robot" in frame for frame in frames)


def _answers(port: int) -> bool:
    try:
        httpx.get(f"http://127.0.0.1:{port}/api/v1/health")
    except httpx.TransportError:
        return False
    return True


def test_watch_json_says_nothing_while_nobody_answers(
    plant: Plant, serve: Serve, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = serve(plant)
    get = GatewayClient.get
    calls = iter([False, True, False])

    def shaky(self: GatewayClient, path: str) -> Any:
        if path == "/apps" and next(calls):
            self.url, kept = nowhere(), self.url
            try:
                return get(GatewayClient(self.url), path)
            finally:
                self.url = kept
        return get(self, path)

    monkeypatch.setattr(GatewayClient, "get", shaky)
    watching(monkeypatch, lambda: None, lambda: None)
    assert beacon("watch", "--json", "--url", url) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2


@pytest.mark.parametrize("interval", ["0", "nan", "x", "-1"])
def test_an_interval_must_be_a_time(capsys: Capture, interval: str) -> None:
    assert beacon("watch", f"--interval={interval}") == 2
    assert "is no number of seconds" in capsys.readouterr().err


# check-config


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "gateway.yaml"
        path.write_text(text)
        return path

    return write


def test_check_config_prints_the_effective_configuration_which_is_one_itself(
    file: Callable[[str], Path], capsys: Capture
) -> None:
    assert beacon("check-config", file("sources: {a: {adapter: fake, ttl_s: 3}}")) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("# ok\n")
    assert captured.err == ""
    effective = yaml.safe_load(captured.out)
    assert effective["http"].items() >= {"host": "127.0.0.1", "port": 8080}.items()
    assert effective["sources"]["a"]["ttl_s"] == 3.0
    assert effective["sources"]["a"]["options"]["network"] == "default"
    assert beacon("check-config", file(captured.out)) == 0
    assert capsys.readouterr().out == captured.out


def test_check_config_warns_of_corrections(file: Callable[[str], Path], capsys: Capture) -> None:
    path = file("sources: {a: {adapter: fake, ttl_s: 0}}")
    assert beacon("check-config", path) == 0
    assert capsys.readouterr().err == ("warning: $.sources.a.ttl_s: 0.0 is too small; using 0.1\n")
    assert beacon("check-config", path, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] is True
    assert document["warnings"] == [
        {"path": "$.sources.a.ttl_s", "message": "0.0 is too small; using 0.1"}
    ]
    assert document["config"]["sources"]["a"]["ttl_s"] == 0.1


def test_check_config_shows_every_problem(file: Callable[[str], Path], capsys: Capture) -> None:
    path = file("htp: {}\nlog_level: loud\nsources: {a: {adapter: fake, ttl_s: .nan}}")
    assert beacon("check-config", path) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.splitlines() == [
        f"beacon: {path}: 3 problems",
        "  $.htp: unknown key; did you mean 'http'?",
        "  $.sources.a.ttl_s: found the number nan; give a finite number",
        "  $.log_level: found the text 'loud'; give one of debug, info, warning, error",
    ]
    assert beacon("check-config", path, "--json") == 2
    document = json.loads(capsys.readouterr().out)
    assert document["ok"] is False
    assert [problem["path"] for problem in document["problems"]] == [
        "$.htp",
        "$.sources.a.ttl_s",
        "$.log_level",
    ]


def test_check_config_of_a_file_that_is_none(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "nope.yaml"
    assert beacon("check-config", path) == 2
    assert capsys.readouterr().err == f"beacon: {path}: No such file or directory\n"
    assert beacon("check-config", path, "--json") == 2
    assert json.loads(capsys.readouterr().out)["problems"] == [
        {"path": "$", "message": f"{path}: No such file or directory"}
    ]


# run


@pytest.fixture
def network() -> Iterator[str]:
    """The name of a simulated network that exists."""
    name = f"test-{os.getpid()}-{time.monotonic_ns()}"
    share_network(FakeNetwork(ManualClock()), name)
    yield name
    unshare_network(name)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_run_serves_until_told_to_stop(
    file: Callable[[str], Path], network: str, capsys: Capture, number: signal.Signals
) -> None:
    path = file(f"sources: {{a: {{adapter: fake, ttl_s: 0, options: {{network: {network}}}}}}}")
    port = free_port()
    seen: list[int] = []

    def stop_when_serving() -> None:
        eventually(lambda: _answers(port))
        seen.append(httpx.get(f"http://127.0.0.1:{port}/api/v1/health").status_code)
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=stop_when_serving)
    thread.start()
    assert beacon("run", "-c", path, "--port", str(port), "--json", "--log-level", "info") == 0
    thread.join()
    captured = capsys.readouterr()
    assert seen == [200]
    assert json.loads(captured.out) == {"url": f"http://127.0.0.1:{port}"}
    assert "$.sources.a.ttl_s: 0.0 is too small; using 0.1" in captured.err
    assert "stopped" in captured.err


def test_run_says_when_the_port_is_in_use(
    file: Callable[[str], Path], network: str, capsys: Capture
) -> None:
    path = file(f"sources: {{a: {{adapter: fake, options: {{network: {network}}}}}}}")
    with closing(HttpServer("127.0.0.1", 0)) as server:
        port = server.url.rpartition(":")[2]
        assert beacon("run", "-c", path, "--port", port, "--host", "127.0.0.1") == 1
    (line,) = [one for one in capsys.readouterr().err.splitlines() if one.startswith("beacon:")]
    assert f"127.0.0.1:{port} is already in use" in line


def test_run_says_when_a_source_cannot_be_had(file: Callable[[str], Path], capsys: Capture) -> None:
    path = file("http: {port: 0}\nsources: {a: {adapter: fake, options: {network: missing}}}")
    assert beacon("run", "-c", path) == 1
    assert "beacon: $.sources.a: " in capsys.readouterr().err


def test_run_refuses_a_wrong_configuration(file: Callable[[str], Path], capsys: Capture) -> None:
    assert beacon("run", "-c", file("sources: {a: {adapter: nope}}")) == 2
    assert "$.sources.a.adapter: no adapter 'nope' is installed" in capsys.readouterr().err


@pytest.mark.parametrize("port", ["x", "-1", "65536"])
def test_run_refuses_what_is_no_port(capsys: Capture, port: str) -> None:
    assert beacon("run", f"--port={port}") == 2
    assert "is no port, 0 to 65535" in capsys.readouterr().err


# announce


class Heard:
    """A sink that writes down what it hears."""

    def __init__(self) -> None:
        self.hints: list[dict[str, Any]] = []
        self.goodbyes: list[str] = []

    def offer(self, payload: bytes, source: str, **_: object) -> Any:
        self.hints.append(json.loads(payload))

    def goodbye(self, entity_id: str, source: str, **_: object) -> Any:
        self.goodbyes.append(entity_id)

    def lost(self, entity_id: str, source: str, **_: object) -> Any:
        raise AssertionError(entity_id)


@pytest.fixture
def air() -> Iterator[tuple[str, FakeNetwork, Heard]]:
    """A simulated network with one listener: its name, itself, and what was heard."""
    name = f"air-{os.getpid()}-{time.monotonic_ns()}"
    network, heard = FakeNetwork(ManualClock()), Heard()
    share_network(network, name)
    source = FakeSource(network)
    source.start(heard)
    yield name, network, heard
    source.close()
    unshare_network(name)


def announce(air: tuple[str, FakeNetwork, Heard], *arguments: str | Path) -> int:
    """Announce on the simulated network for a moment."""
    way = ("--adapter", "fake", "--option", f"network={air[0]}", "--duration", "0.05")
    code = beacon("announce", *arguments, *way)
    air[1].run_until_idle()
    return code


def test_announce_says_every_field_and_in_the_end_goodbye(
    air: tuple[str, FakeNetwork, Heard], capsys: Capture
) -> None:
    arguments = (
        "--entity-id engine_temp --stable-id s --display-name Engine --function-ids f g "
        "--depends-on d --component-id ecu --transport-type shm --negotiated-format fmt "
        "--process-id 42 --process-name node --hostname robot --metadata a=1 b=x=y"
    )
    assert announce(air, *arguments.split()) == 0
    heard = air[2]
    assert heard.goodbyes == ["engine_temp"]
    hint = heard.hints[0]
    assert {key: value for key, value in hint.items() if key != "stamp"} == {
        "entity_id": "engine_temp",
        "stable_id": "s",
        "display_name": "Engine",
        "function_ids": ["f", "g"],
        "depends_on": ["d"],
        "component_id": "ecu",
        "transport_type": "shm",
        "negotiated_format": "fmt",
        "process_id": 42,
        "process_name": "node",
        "hostname": "robot",
        "metadata": {"a": "1", "b": "x=y"},
    }
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "announcing engine_temp over fake every 2 s" in captured.err
    assert "said goodbye" in captured.err


def test_announce_fills_in_who_speaks(air: tuple[str, FakeNetwork, Heard]) -> None:
    assert announce(air, "--entity-id", "a") == 0
    hint = air[2].hints[0]
    assert hint["process_id"] == os.getpid()
    assert hint["hostname"] == socket.gethostname()
    assert hint["process_name"] == "beacon"


def test_announce_takes_a_file_of_one_hint_or_several(
    air: tuple[str, FakeNetwork, Heard], file: Callable[[str], Path], capsys: Capture
) -> None:
    assert announce(air, file("{entity_id: one, metadata: {a: b}}")) == 0
    assert announce(air, file("- {entity_id: two, hostname: h}\n- {entity_id: three}")) == 0
    heard = air[2]
    assert [hint["entity_id"] for hint in heard.hints] == ["one", "two", "three"]
    assert [hint["hostname"] for hint in heard.hints][1:] == ["h", socket.gethostname()]
    assert heard.goodbyes == ["one", "two", "three"]
    capsys.readouterr()


def test_announce_tells_what_it_had_to_mend(
    air: tuple[str, FakeNetwork, Heard], capsys: Capture
) -> None:
    assert announce(air, "--entity-id", "a", "--display-name", "x" * 600) == 0
    assert "a: $.display_name: " in capsys.readouterr().err
    assert len(air[2].hints[0]["display_name"]) == 512


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_announce_says_goodbye_when_told_to_stop(
    air: tuple[str, FakeNetwork, Heard], number: signal.Signals
) -> None:
    name, network, heard = air

    def stop_when_announced() -> None:
        eventually(lambda: bool(network.run_until_idle() or heard.hints))
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=stop_when_announced)
    thread.start()
    way = ("--adapter", "fake", "--option", f"network={name}")
    assert beacon("announce", "--entity-id", "a", *way) == 0
    thread.join()
    network.run_until_idle()
    assert heard.goodbyes == ["a"]


@pytest.mark.parametrize(
    ("content", "problems"),
    [
        ("{entity_id: a, hostnam: h}", ["$.hostnam: unknown key; did you mean 'hostname'?"]),
        (
            "- {entity_id: a}\n- {process_id: x}",
            [
                "$[1].entity_id: missing; give a text",
                "$[1].process_id: found the text 'x'; give a whole number",
            ],
        ),
        ("hello", ["$: found the text 'hello'; give keys with values"]),
    ],
)
def test_announce_refuses_a_wrong_file_with_every_problem(
    file: Callable[[str], Path], capsys: Capture, content: str, problems: list[str]
) -> None:
    path = file(content)
    assert beacon("announce", path) == 2
    count = f"{len(problems)} problem{'s' if len(problems) > 1 else ''}"
    assert capsys.readouterr().err.splitlines() == [
        f"beacon: {path}: {count}",
        *(f"  {problem}" for problem in problems),
    ]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "say what to announce: a FILE, or at least --entity-id"),
        (("--hostname", "h"), "say what to announce: a FILE, or at least --entity-id"),
        (("file.yaml", "--entity-id", "a"), "give a file or --entity-id, not both"),
        (("--entity-id", "a b"), "this hint would be refused: "),
        (("--entity-id", "a", "--process-id", "-1"), "no process id, 0 to 4294967295"),
        (("--entity-id", "a", "--process-id", "4294967296"), "no process id, 0 to 4294967295"),
        (("--entity-id", "a", "--metadata", "x"), "'x' is not of the form KEY=VALUE"),
        (("--entity-id", "a", "--metadata", "=x"), "'=x' is not of the form KEY=VALUE"),
        (("--entity-id", "a", "--period", "0"), "'0' is no number of seconds"),
        (("--entity-id", "a", "--adapter", "zeno"), "no adapter 'zeno' is installed"),
        (("--entity-id", "a", "--option", "x=["), "'x=[': the value is not YAML"),
        (
            ("--entity-id", "a", "--adapter", "fake", "--option", "nam=x"),
            "$.nam: unknown key; did you mean 'name'?",
        ),
        (
            ("--entity-id", "a", "--adapter", "fake", "--connect", "tcp/x:1"),
            "$.connect: unknown key",
        ),
    ],
)
def test_announce_refuses_wrong_usage(
    capsys: Capture, arguments: tuple[str, ...], said: str
) -> None:
    assert beacon("announce", *arguments) == 2
    assert said in capsys.readouterr().err


def test_announce_says_when_the_carrier_cannot_be_had(capsys: Capture) -> None:
    way = ("--adapter", "fake", "--option", "network=missing")
    assert beacon("announce", "--entity-id", "a", *way) == 1
    assert "beacon: network: no fake network is called 'missing'" in capsys.readouterr().err


# the table


def shown_headings(items: list[dict[str, Any]], width: int) -> list[str]:
    table = entity_table(items, width=width)
    return [str(column.header) for column in table.columns]


def test_a_narrow_terminal_leaves_out_what_can_best_be_missed(busy: tuple[Plant, str]) -> None:
    with GatewayClient(busy[1]) as client:
        items = client.entities()
    everything = ["ENTITY", "STATUS", "AGE", "NAME", "COMPONENT", "PROCESS", "SOURCE", "NOTE"]
    assert shown_headings(items, 200) == everything
    seen = [tuple(shown_headings(items, width)) for width in range(200, 20, -1)]
    assert list(dict.fromkeys(seen)) == [
        tuple(everything),
        ("ENTITY", "STATUS", "AGE", "NAME", "COMPONENT", "PROCESS", "NOTE"),
        ("ENTITY", "STATUS", "AGE", "COMPONENT", "PROCESS", "NOTE"),
        ("ENTITY", "STATUS", "AGE", "PROCESS", "NOTE"),
        ("ENTITY", "STATUS", "AGE", "NOTE"),
    ]


def test_more_entities_than_lines_are_counted(busy: tuple[Plant, str]) -> None:
    with GatewayClient(busy[1]) as client:
        table = entity_table(by_attention(client.entities()), width=100, rows=3)
    assert table.row_count == 4
    assert list(table.columns[0].cells)[-1] == Text("… and 4 more", "dim")


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [
        (0.04, "0.0 s"),
        (9.94, "9.9 s"),
        (10, "10 s"),
        (119, "119 s"),
        (120, "2 min"),
        (7_300, "2 h"),
        (200_000, "2 d"),
    ],
)
def test_durations_are_short(seconds: float, shown: str) -> None:
    assert duration(seconds) == shown


# watch in a real terminal


def test_watch_redraws_a_terminal_and_leaves_it_as_it_was(
    plant: Plant, serve: Serve, monkeypatch: pytest.MonkeyPatch
) -> None:
    plant.announce("robot")
    url = serve(plant)
    controller, terminal = pty.openpty()
    drawn: list[bytes] = []

    def read() -> None:
        with suppress(OSError):
            while chunk := os.read(controller, 65536):
                drawn.append(chunk)

    reader = threading.Thread(target=read)
    reader.start()
    monkeypatch.setenv("TERM", "xterm-256color")
    with os.fdopen(terminal, "w") as screen:
        monkeypatch.setattr(sys, "stdout", screen)
        watching(monkeypatch, lambda: plant.announce("late"))
        assert beacon("watch", "--url", url) == 0
    reader.join(10)
    os.close(controller)
    picture = b"".join(drawn)
    assert picture.startswith(b"\x1b[?1049h")
    assert b"robot" in picture
    assert b"late" in picture
    assert b"\x1b[?1049l" in picture


# demo


PARTS = ("arm", "base", "lidar", "planner")


def test_demo_tells_what_happens_and_what_the_gateway_makes_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = ("picker_1", "picker_2", "hauler_1")
    told = io.StringIO()
    monkeypatch.setattr(sys, "stdout", told)

    def all_active() -> bool:
        parts = [f"{name}_{part}" for name in names for part in PARTS]
        active = [line for line in told.getvalue().splitlines() if "gateway: active: " in line]
        return all(any(part in line for line in active) for part in parts)

    def stop_when_all_are_active() -> None:
        eventually(all_active, within_s=60)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=stop_when_all_are_active)
    thread.start()
    assert beacon("demo", "--port", "0") == 0
    thread.join()
    lines = [line.split(" ", 1)[1] for line in told.getvalue().splitlines()]
    assert lines[0].startswith("gateway: http://127.0.0.1:")
    assert {f"{name} starts" for name in names} < set(lines)
    assert lines[-1] == "the demo ends; everybody says goodbye"


def test_demo_ends_by_itself_after_its_duration(capsys: Capture) -> None:
    assert beacon("demo", "--port", "0", "--duration", "0.7") == 0
    assert "the demo ends; everybody says goodbye" in capsys.readouterr().out


def test_the_demo_needs_its_port(capsys: Capture) -> None:
    with closing(HttpServer("127.0.0.1", 0)) as server:
        assert beacon("demo", "--port", server.url.rpartition(":")[2]) == 1
    assert "is already in use" in capsys.readouterr().err


def test_one_seed_one_story() -> None:
    def story(seed: int) -> list[Step]:
        return list(islice(script(seed, ("a", "b")), 12))

    assert story(1) == story(1) != story(2)
    assert [step.action for step in story(1)[:2]] == ["start", "start"]


def test_every_mishap_is_remedied_before_the_next() -> None:
    steps = list(islice(script(3, ("a", "b")), 2, 202))
    remedies = {"kill": "restart", "goodbye": "restart", "freeze": "thaw"}
    for mishap, remedy in zip(steps[::2], steps[1::2], strict=True):
        assert remedies[mishap.action] == remedy.action
        assert mishap.robot == remedy.robot
    assert {step.action for step in steps[::2]} == set(remedies)


def test_the_fleet_does_as_told_and_ends_with_the_demo() -> None:
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    document = {
        "sources": {
            "fleet": {"adapter": "zenoh", "options": {"mode": "router", "listen": [endpoint]}}
        }
    }
    gateway = Gateway(parse_config(document).config)

    def state(robot: str) -> str | None:
        beacon = gateway.directory.beacon(f"{robot}_base")
        return None if beacon is None else beacon.status.value

    with closing(gateway):
        gateway.start()
        with Fleet(("a", "b"), {"connect": [endpoint]}) as fleet:
            for action, becomes in (
                ("start", "active"),
                ("kill", "stale"),
                ("restart", "active"),
                ("goodbye", "left"),
                ("restart", "active"),
                ("freeze", "stale"),
                ("thaw", "active"),
            ):
                fleet.do(Step(0, "a", action))
                eventually(lambda wanted=becomes: state("a") == wanted, 60)  # type: ignore[misc]
            fleet.do(Step(0, "b", "start"))
            eventually(lambda: state("b") == "active", 60)
        eventually(lambda: state("a") == state("b") == "left", 60)


def test_a_robot_that_does_not_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("beacon_gateway.console.fleet._CLOSE_WITHIN_S", 0.1)
    with Fleet(("a",), {}) as fleet:
        fleet.do(Step(0, "a", "start"))
        fleet.do(Step(0, "a", "freeze"))
        (process,) = fleet._running.values()
        fleet.do(Step(0, "a", "goodbye"))
        assert process.returncode == -signal.SIGKILL


def test_a_robot_announces_until_its_input_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    order = {"options": {"connect": [endpoint]}, "hints": [{"entity_id": "a"}]}
    monkeypatch.setattr(sys, "stdin", io.StringIO(json.dumps(order) + "\n"))
    before = signal.getsignal(signal.SIGINT)
    try:
        robot.main()
    finally:
        signal.signal(signal.SIGINT, before)


def test_announce_tells_that_nobody_is_there_and_that_no_goodbye_was_heard(
    capsys: Capture,
) -> None:
    way = ("--connect", f"tcp/127.0.0.1:{free_port()}", "--duration", "0.2")
    assert beacon("announce", "--entity-id", "a", *way) == 0
    said = capsys.readouterr().err
    assert said.count("No connection to tcp/127.0.0.1") == 1
    assert "ended without a goodbye: nobody was there to hear it" in said


def test_announce_tells_when_its_gateway_has_come(capsys: Capture) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    options = {"mode": "router", "listen": [endpoint]}
    document = {"sources": {"robots": {"adapter": "zenoh", "options": options}}}
    gateway = Gateway(parse_config(document).config)

    log = logging.getLogger(announce_command.__name__)
    told: list[str] = []

    class Listen(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            told.append(record.getMessage())

    def come_late() -> None:
        eventually(lambda: any(one.startswith("No connection to") for one in told))
        gateway.start()
        eventually(lambda: "connected" in told)
        os.kill(os.getpid(), signal.SIGINT)

    listen = Listen()
    log.addHandler(listen)
    thread = threading.Thread(target=come_late)
    thread.start()
    with closing(gateway):
        assert beacon("announce", "--entity-id", "a", "--connect", endpoint) == 0
        thread.join()
    log.removeHandler(listen)
    said = capsys.readouterr().err
    assert said.index("No connection to") < said.index("connected") < said.index("said goodbye")


def test_a_carrier_that_gives_no_reason_is_named_by_its_condition() -> None:
    assert announce_command._trouble(Health(Condition.DOWN)) == "the carrier is down"
    assert announce_command._trouble(Health(Condition.UP)) == ""
