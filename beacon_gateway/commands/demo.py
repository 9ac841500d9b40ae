"""``beacon demo``: a gateway with a small fleet that comes, crashes, leaves and comes back."""

from __future__ import annotations

import argparse
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from beacon_gateway.commands.run import opened
from beacon_gateway.config import Config, LogLevel, parse_config
from beacon_gateway.console.client import GatewayClient
from beacon_gateway.console.exits import Exit
from beacon_gateway.console.flags import port, seconds
from beacon_gateway.console.fleet import Fleet, script
from beacon_gateway.console.logs import set_up_logging
from beacon_gateway.console.signals import on_stop_signal
from beacon_gateway.console.terminal import printable
from beacon_gateway.http import create_app
from beacon_gateway.server import free_port

__all__ = ["parser", "run"]

_ROBOTS = ("picker_1", "picker_2", "hauler_1")
_TTL_S = 4.0
_LOOK_S = 0.1
_STOP_WITHIN_S = 2.0

_ACTIONS: Mapping[str, str] = {
    "start": "starts",
    "kill": "is killed (kill -9)",
    "goodbye": "leaves with a goodbye",
    "restart": "starts again",
    "freeze": "freezes (SIGSTOP)",
    "thaw": "goes on (SIGCONT)",
}


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Run a gateway with a small simulated fleet: robots are processes that "
        "announce over real Zenoh; they start, are killed, leave and come back. Prints what "
        "happens to them, and what the gateway says of it, until Ctrl-C."
    )
    made.add_argument("--port", type=port, default=8080, help="HTTP (default: 8080; 0: any free)")
    made.add_argument("--duration", type=seconds, metavar="S", help="stop by itself after this")
    made.add_argument("--seed", type=int, default=1, help="another seed, another story")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code, once stopped."""
    set_up_logging(LogLevel.WARNING)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    stop = threading.Event()
    with on_stop_signal(stop.set), _serving(_config(endpoint, arguments.port)) as url:
        _say(f"gateway: {url}/api/v1/apps   robots announce to {endpoint}")
        _say(f"try: beacon watch --url {url}")
        _say(f"     curl {url}/api/v1/apps/{_ROBOTS[0]}_lidar/x-medkit-beacon")
        with (
            Fleet(_ROBOTS, {"connect": [endpoint]}) as fleet,
            GatewayClient(url) as client,
        ):
            _play(fleet, _Observer(client), stop, arguments)
            _say("the demo ends; everybody says goodbye")
    return Exit.OK


def _play(
    fleet: Fleet, observer: _Observer, stop: threading.Event, arguments: argparse.Namespace
) -> None:
    end_s = time.monotonic() + (arguments.duration or float("inf"))
    for step in script(arguments.seed, fleet.robots):
        due_s = min(time.monotonic() + step.after_s, end_s)
        while time.monotonic() < due_s:
            if stop.wait(min(_LOOK_S, max(0.0, due_s - time.monotonic()))):
                return
            observer.look()
        if time.monotonic() >= end_s:
            return
        _say(f"{step.robot} {_ACTIONS[step.action]}")
        fleet.do(step)


class _Observer:
    """Says over HTTP what has changed in the gateway's eyes."""

    def __init__(self, client: GatewayClient) -> None:
        self._client = client
        self._seen: dict[str, str] = {}

    def look(self) -> None:
        now = {item["id"]: _state(item) for item in self._client.entities()}
        changed: dict[str, list[str]] = {}
        for entity_id, state in now.items():
            if self._seen.get(entity_id) != state:
                changed.setdefault(state, []).append(entity_id)
        for entity_id in self._seen.keys() - now.keys():
            changed.setdefault("gone", []).append(entity_id)
        for state, entity_ids in changed.items():
            _say(f"    gateway: {printable(state)}: {', '.join(sorted(entity_ids))}")
        self._seen = now


def _state(item: Mapping[str, Any]) -> str:
    beacon = item["x-medkit"].get("beacon", {})
    state = str(beacon.get("status", "known"))
    if state == "stale":
        return f"stale ({beacon.get('reason') or beacon['cause']})"
    return f"{state}, restarts: {beacon['restarts']}" if beacon.get("restarts") else state


def _config(endpoint: str, http_port: int) -> Config:
    components = [{"id": robot, "name": robot.replace("_", " ").title()} for robot in _ROBOTS]
    functions = [{"id": name} for name in ("drive", "perceive", "handle")]
    source = {
        "adapter": "zenoh",
        "ttl_s": _TTL_S,
        "options": {"mode": "router", "listen": [endpoint]},
    }
    document = {
        "http": {"port": http_port},
        "sources": {"fleet": source},
        "entities": {"components": components, "functions": functions},
    }
    return parse_config(document).config


@contextmanager
def _serving(config: Config) -> Iterator[str]:
    """A gateway behind HTTP, in a thread of its own."""
    with opened(config) as (server, gateway):
        serving = threading.Thread(target=server.serve, args=(create_app(gateway),), daemon=True)
        serving.start()
        try:
            yield server.url
        finally:
            server.stop()
            serving.join(_STOP_WITHIN_S)


def _say(line: str) -> None:
    sys.stdout.write(f"{time.strftime('%H:%M:%S')} {line}\n")
    sys.stdout.flush()
