"""The whole way, with real processes over real Zenoh: announce, crash, goodbye, restart."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import attrs
import httpx
import pytest

pytestmark = pytest.mark.system

BEACON = (sys.executable, "-m", "beacon_gateway")

Process = subprocess.Popen[str]


def free_endpoint() -> str:
    with socket.create_server(("127.0.0.1", 0)) as bound:
        return f"tcp/127.0.0.1:{bound.getsockname()[1]}"


def eventually(true: Callable[[], object], within_s: float = 20.0) -> None:
    """Wait until it is true. The default is for starting processes on a busy machine."""
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, f"not within {within_s} s"
        time.sleep(0.01)


@attrs.frozen
class Shop:
    """A running gateway, and announcers for it."""

    processes: list[Process]
    url: str
    endpoint: str
    gateway: Process
    config: Path

    def announce(self, *arguments: str | Path) -> Process:
        return start(
            self.processes, "announce", *arguments, "--connect", self.endpoint, "--period", "0.5"
        )

    def beacon(self, entity_id: str) -> tuple[int, dict[str, Any]]:
        response = httpx.get(f"{self.url}/api/v1/apps/{entity_id}/x-medkit-beacon", timeout=10)
        return response.status_code, response.json()

    def status(self, entity_id: str) -> str:
        """As the vendor endpoint tells it: active, stale, left; or an error code."""
        code, body = self.beacon(entity_id)
        if code == httpx.codes.OK:
            return str(body["status"])
        return str(body.get("parameters", {}).get("status", body["error_code"]))

    def becomes(self, entity_id: str, status: str, within_s: float = 20.0) -> None:
        eventually(lambda: self.status(entity_id) == status, within_s)

    def run(self, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
        """A command that ends by itself."""
        return run(*arguments, "--url", self.url)


def start(processes: list[Process], *arguments: str | Path) -> Process:
    process = subprocess.Popen(
        [*BEACON, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    processes.append(process)
    return process


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*BEACON, *map(str, arguments)], capture_output=True, text=True, timeout=60, check=False
    )


def stop(process: Process, number: signal.Signals = signal.SIGTERM) -> tuple[int, str]:
    """Send the signal; returns the exit code and what it had said on stderr."""
    process.send_signal(number)
    _, said = process.communicate(timeout=20)
    return process.returncode, said


def start_gateway(processes: list[Process], config: Path, *arguments: str) -> tuple[Process, str]:
    gateway = start(processes, "run", "-c", config, "--json", *arguments)
    assert gateway.stdout is not None
    line = gateway.stdout.readline()
    assert line, gateway.communicate(timeout=20)[1]
    url: str = json.loads(line)["url"]
    return gateway, url


@pytest.fixture
def processes() -> Iterator[list[Process]]:
    started: list[Process] = []
    yield started
    for process in started:
        with suppress(ProcessLookupError):
            process.kill()
        process.communicate(timeout=20)


@pytest.fixture
def shop(processes: list[Process], tmp_path: Path) -> Shop:
    """A gateway on ports that the system chose. Its ttl is long: silence plays no part."""
    endpoint = free_endpoint()
    config = tmp_path / "gateway.yaml"
    config.write_text(
        f"""
        http: {{port: 0}}
        sources:
          robots: {{adapter: zenoh, ttl_s: 30, options: {{mode: router, listen: ["{endpoint}"]}}}}
        entities:
          components: [{{id: ecu_front, name: Front ECU}}]
        """
    )
    gateway, url = start_gateway(processes, config)
    return Shop(processes, url, endpoint, gateway, config)


ENGINE = ("--entity-id", "engine_temp", "--display-name", "Engine temperature")


def test_an_announced_entity_is_active_with_all_it_said(shop: Shop) -> None:
    announcer = shop.announce(*ENGINE, "--component-id", "ecu_front", "--metadata", "firmware=1.2")
    shop.becomes("engine_temp", "active")
    _, body = shop.beacon("engine_temp")
    assert body["display_name"] == "Engine temperature"
    assert body["component_id"] == "ecu_front"
    assert body["metadata"] == {"firmware": "1.2"}
    assert body["process_id"] == announcer.pid
    assert body["hostname"] == socket.gethostname()
    assert body["sources"][0]["source"] == "robots"
    (item,) = httpx.get(f"{shop.url}/api/v1/apps").json()["items"]
    assert (item["id"], item["x-medkit"]["source"]) == ("engine_temp", "beacon")
    assert item["x-medkit"]["is_online"] is True


def test_a_killed_announcer_is_stale_within_a_second_and_back_after_a_restart(shop: Shop) -> None:
    first = shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")
    first.kill()
    shop.becomes("engine_temp", "stale", within_s=1.0)
    _, body = shop.beacon("engine_temp")
    assert (body["cause"], body["restarts"]) == ("lost", 0)
    assert body["reason"]
    second = shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")
    _, body = shop.beacon("engine_temp")
    assert (body["process_id"], body["restarts"]) == (second.pid, 1)
    assert [step["status"] for step in body["history"]] == ["stale", "active"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_announcer_told_to_stop_says_goodbye_and_is_shown_as_left(
    shop: Shop, number: signal.Signals
) -> None:
    announcer = shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")
    code, said = stop(announcer, number)
    assert code == 0
    assert "said goodbye" in said
    shop.becomes("engine_temp", "left", within_s=1.0)
    code, body = shop.beacon("engine_temp")
    assert code == 404
    assert body["vendor_code"] == "x-medkit-beacon-not-found"
    assert body["parameters"]["entity_id"] == "engine_temp"
    (item,) = httpx.get(f"{shop.url}/api/v1/apps").json()["items"]
    assert item["x-medkit"]["is_online"] is False
    assert item["x-medkit"]["beacon"]["status"] == "left"
    shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")


def test_an_announcer_that_waits_for_its_gateway_is_heard_once_that_is_there(
    processes: list[Process], shop: Shop
) -> None:
    assert stop(shop.gateway)[0] == 0
    shop.announce(*ENGINE)
    _, url = start_gateway(processes, shop.config)
    late = attrs.evolve(shop, url=url)
    late.becomes("engine_temp", "active")


def test_a_gateway_that_starts_late_hears_of_those_present_and_can_be_restarted(
    processes: list[Process], shop: Shop
) -> None:
    shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")
    port = shop.url.rpartition(":")[2]
    watch = start(processes, "watch", "--json", "--interval", "0.1", "--url", shop.url)
    assert watch.stdout is not None
    assert json.loads(watch.stdout.readline())[0]["x-medkit"]["beacon"]["status"] == "active"
    assert stop(shop.gateway)[0] == 0
    start_gateway(processes, shop.config, "--port", port)
    # Whatever the new gateway knows of the first one, the announcer told it by itself.
    shop.announce("--entity-id", "late")
    while {"engine_temp", "late"} - {item["id"] for item in json.loads(watch.stdout.readline())}:
        pass
    assert stop(watch, signal.SIGINT)[0] == 0


def test_a_file_announces_several_entities_by_one_process(shop: Shop, tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text("- {entity_id: lidar, function_ids: [map]}\n- {entity_id: arm}\n")
    announcer = shop.announce(path)
    shop.becomes("lidar", "active")
    shop.becomes("arm", "active")
    announcer.kill()
    shop.becomes("lidar", "stale", within_s=1.0)
    shop.becomes("arm", "stale", within_s=1.0)


def test_get_and_watch_show_it_and_their_exit_codes_tell(shop: Shop) -> None:
    announcer = shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")

    listed = shop.run("get")
    assert listed.returncode == 0
    assert listed.stderr == ""
    assert [line.split()[:2] for line in listed.stdout.splitlines()] == [
        ["ENTITY", "STATUS"],
        ["engine_temp", "active"],
        ["ecu_front", "-"],
    ]
    one = shop.run("get", "engine_temp", "--json")
    assert (one.returncode, json.loads(one.stdout)["status"]) == (0, "active")
    watched = shop.run("watch", "--once", "--json")
    assert watched.returncode == 0
    assert [item["id"] for item in json.loads(watched.stdout)] == ["engine_temp", "ecu_front"]
    nobody = shop.run("get", "nobody")
    assert (nobody.returncode, nobody.stdout) == (3, "")
    assert nobody.stderr.startswith("beacon: no entity nobody; ")

    stop(announcer)
    shop.becomes("engine_temp", "left")
    left = shop.run("get", "engine_temp")
    assert left.returncode == 3
    assert left.stderr.startswith("beacon: engine_temp left ")
    assert shop.run("get", "engine_temp", "--json").returncode == 3

    assert stop(shop.gateway)[0] == 0
    for command in (("get",), ("watch", "--once")):
        gone = shop.run(*command)
        assert gone.returncode == 1
        assert gone.stderr == (
            f"beacon: no gateway answers at {shop.url}; "
            "start one with 'beacon run', or name another with --url\n"
        )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_gateway_told_to_stop_ends_promptly_with_0_though_it_is_busy(
    shop: Shop, number: signal.Signals
) -> None:
    shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")
    with httpx.Client() as client:
        client.get(f"{shop.url}/api/v1/health")
        began = time.monotonic()
        code, said = stop(shop.gateway, number)
        assert time.monotonic() - began < 3.0
    assert code == 0
    assert "Traceback" not in said
    assert said.splitlines()[-1].endswith("stopped")


def test_a_second_gateway_is_told_in_one_sentence_what_is_taken(shop: Shop, tmp_path: Path) -> None:
    http_port = shop.url.rpartition(":")[2]
    same_http = run("run", "-c", shop.config, "--port", http_port)
    assert same_http.returncode == 1
    assert same_http.stderr.startswith(f"beacon: 127.0.0.1:{http_port} is already in use")
    same_zenoh = run("run", "-c", shop.config)
    assert same_zenoh.returncode == 1
    assert "Traceback" not in same_zenoh.stderr
    last = same_zenoh.stderr.splitlines()[-1]
    assert last.startswith("beacon: $.sources.robots: ")
    assert shop.endpoint in last


def test_check_config_tells_what_is_wrong_and_nothing_is_started(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("sources: {robots: {adapter: zenoh, options: {mode: ruter, lisen: []}}}\n")
    for command in (("check-config", path), ("run", "-c", path)):
        done = run(*command)
        assert done.returncode == 2
        assert done.stdout == ""
        assert "$.sources.robots.options.mode: " in done.stderr
        assert "did you mean 'router'?" in done.stderr
        assert "$.sources.robots.options.lisen: unknown key; did you mean 'listen'?" in done.stderr
    good = run("check-config")
    assert (good.returncode, good.stderr) == (0, "")
    assert good.stdout.startswith("# ok\n")
    assert "tcp/127.0.0.1:7447" in good.stdout


def test_output_goes_to_stdout_and_logs_to_stderr(shop: Shop) -> None:
    announcer = shop.announce(*ENGINE)
    shop.becomes("engine_temp", "active")
    announcer.send_signal(signal.SIGINT)
    out, said = announcer.communicate(timeout=20)
    assert out == ""
    assert "announcing engine_temp over zenoh" in said
    shop.gateway.terminate()
    out, said = shop.gateway.communicate(timeout=20)
    assert out == ""
    assert f"serving {shop.url}" in said
