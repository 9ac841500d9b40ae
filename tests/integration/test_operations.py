"""Running a gateway: reading again, stopping with streams open, and what is known afterwards."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import attrs
import httpx
import pytest

from beacon_core.hint import BeaconHint
from beacon_gateway.adapters import load_adapter

pytestmark = pytest.mark.system


def free_port() -> int:
    with closing(socket.create_server(("127.0.0.1", 0))) as bound:
        return int(bound.getsockname()[1])


def eventually(true: Callable[[], object], within_s: float = 20.0) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, f"not within {within_s} s"
        time.sleep(0.02)


@attrs.define
class Gateway:
    """``beacon run`` with a file that can be changed."""

    path: Path
    endpoint: str
    process: subprocess.Popen[bytes] | None = None
    url: str = ""

    def write(self, more: str = "", http: str = "{port: 0}") -> None:
        options = f"{{mode: router, listen: [{self.endpoint}]}}"
        self.path.write_text(
            f"http: {http}\nlog_format: json\n"
            f"sources: {{robots: {{adapter: zenoh, options: {options}}}}}\n{more}"
        )

    def start(self) -> None:
        command = [sys.executable, "-m", "beacon_gateway", "run", "-c", str(self.path), "--json"]
        out = self.path.with_suffix(".out")
        with out.open("w") as stdout, self._log.open("w") as stderr:
            self.process = subprocess.Popen(command, stdout=stdout, stderr=stderr)
        eventually(lambda: out.read_text().endswith("\n"))
        self.url = json.loads(out.read_text())["url"]

    @property
    def _log(self) -> Path:
        return self.path.with_suffix(".log")

    def stop(self, number: signal.Signals = signal.SIGTERM) -> int:
        assert self.process is not None
        self.process.send_signal(number)
        return self.process.wait(15)

    def hang_up(self) -> None:
        assert self.process is not None
        self.process.send_signal(signal.SIGHUP)

    def get(self, path: str) -> httpx.Response:
        return httpx.get(self.url + path, timeout=10)

    def status(self, entity_id: str) -> str:
        body = self.get(f"/api/v1/apps/{entity_id}/x-medkit-beacon").json()
        return str(body.get("status", ""))

    def has_said(self, words: str) -> bool:
        lines = self._log.read_text().splitlines()
        return any(words in json.loads(line)["message"] for line in lines)


@pytest.fixture
def gateway(tmp_path: Path) -> Iterator[Gateway]:
    made = Gateway(tmp_path / "gateway.yaml", f"tcp/127.0.0.1:{free_port()}")
    yield made
    if made.process is not None:
        with suppress(ProcessLookupError):
            made.process.kill()
        made.process.wait(10)


def announcer(gateway: Gateway) -> Any:
    adapter = load_adapter("zenoh")
    return adapter.announcer(adapter.options(connect=(gateway.endpoint,)), 0.5)


def test_sighup_reads_again_and_a_bad_file_changes_nothing(gateway: Gateway) -> None:
    gateway.write()
    gateway.start()
    eventually(lambda: gateway.get("/readyz").status_code == 200)
    assert gateway.get("/livez").status_code == 200
    gateway.write("entities: {apps: [{id: planner}]}\n")
    gateway.hang_up()
    eventually(lambda: gateway.has_said("reloaded"))
    eventually(lambda: gateway.get("/api/v1/apps/planner").status_code == 200)
    gateway.write("entities: {apps: [{id: 7}]}\n")
    gateway.hang_up()
    eventually(lambda: gateway.has_said("$.entities.apps[0].id: found the number 7"))
    assert gateway.get("/api/v1/apps/planner").status_code == 200
    assert gateway.stop() == 0


def test_who_stops_it_waits_for_no_stream_and_every_stream_is_told(gateway: Gateway) -> None:
    gateway.write()
    gateway.start()
    begun, ended = threading.Semaphore(0), []

    def follow() -> None:
        url = f"{gateway.url}/api/v1/x-medkit-beacon/stream"
        with httpx.stream("GET", url, timeout=20) as stream:
            lines = stream.iter_lines()
            next(lines)
            begun.release()
            ended.append([line for line in lines if line.startswith("event: ")])

    streams = [threading.Thread(target=follow) for _ in range(20)]
    for stream in streams:
        stream.start()
    for _ in streams:
        assert begun.acquire(timeout=20)
    began = time.monotonic()
    assert gateway.stop() == 0
    assert time.monotonic() - began < 5
    for stream in streams:
        stream.join(10)
    assert [events[-1] for events in ended] == ["event: end"] * 20


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGKILL])
def test_after_a_restart_the_last_known_are_shown_until_they_are_heard(
    gateway: Gateway, end: signal.Signals
) -> None:
    gateway.write("snapshot: {path: state.jsonl, every_s: 1}\n")
    gateway.start()
    with closing(announcer(gateway)) as robot, closing(announcer(gateway)) as other:
        robot.announce(BeaconHint("lidar", display_name="Laser"))
        other.announce(BeaconHint("camera"))
        state = gateway.path.with_name("state.jsonl")
        eventually(lambda: gateway.status("lidar") == gateway.status("camera") == "active")
        for name in (b'"lidar"', b'"camera"'):
            eventually(lambda name=name: state.exists() and name in state.read_bytes())  # type: ignore[misc]
        gateway.stop(end)
    # Nobody hears that both go.
    gateway.start()
    assert gateway.status("lidar") == gateway.status("camera") == "stale"
    with closing(announcer(gateway)) as robot:
        robot.announce(BeaconHint("lidar", display_name="Laser"))
        eventually(lambda: gateway.status("lidar") == "active")
        assert gateway.status("camera") == "stale"
    assert gateway.stop() == 0


def test_a_damaged_snapshot_does_not_keep_it_from_starting(gateway: Gateway) -> None:
    gateway.write("snapshot: {path: state.jsonl}\n")
    state = gateway.path.with_name("state.jsonl")
    state.write_bytes(b"\x00" * 1000)
    gateway.start()
    assert gateway.has_said("set aside as state.jsonl.damaged")
    assert gateway.get("/livez").status_code == 200
    assert gateway.stop() == 0
