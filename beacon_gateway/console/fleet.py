"""The simulated fleet of ``beacon demo``: who there is, and what happens to whom.

Robots are processes that announce over real Zenoh. A crash is a real ``kill -9``: nothing else
shows what a gateway makes of one, since an announcer in this process can only leave in order.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, Self

import attrs

__all__ = ["Fleet", "Step", "script"]

_PARTS = (
    ("base", "Drive base", "drive", ()),
    ("lidar", "Laser scanner", "perceive", ("base",)),
    ("arm", "Gripper arm", "handle", ("base",)),
    ("planner", "Route planner", "drive", ("base", "lidar")),
)

_MISHAPS = (("kill", "restart"), ("goodbye", "restart"), ("freeze", "thaw"))

_CLOSE_WITHIN_S = 2.0


@attrs.frozen
class Step:
    """One thing that happens."""

    after_s: float
    """Seconds after the step before."""
    robot: str
    action: str
    """``start``, ``kill``, ``goodbye``, ``restart``, ``freeze`` or ``thaw``."""


def script(seed: int, robots: Sequence[str]) -> Iterator[Step]:
    """Everybody starts; then, without end, somebody crashes, leaves or freezes, and comes back."""
    rng = random.Random(seed)  # noqa: S311 - a simulation, no secret
    for robot in robots:
        yield Step(0.5, robot, "start")
    while True:
        robot = rng.choice(robots)
        mishap, remedy = rng.choice(_MISHAPS)
        yield Step(rng.uniform(2.0, 4.0), robot, mishap)
        # A frozen robot must be silent for the demo's time to live before that shows.
        yield Step(rng.uniform(2.0, 4.0) + 4.0 * (mishap == "freeze"), robot, remedy)


class Fleet:
    """The robots' processes. Thread rule: one thread. Use it as a context manager."""

    def __init__(self, robots: Sequence[str], options: Mapping[str, Any]) -> None:
        """``options`` are those of the zenoh adapter, for an announcer."""
        self.robots = tuple(robots)
        self._options = dict(options)
        self._running: dict[str, subprocess.Popen[str]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._running.values():
            process.send_signal(signal.SIGCONT)
            _end_input(process)
        for process in self._running.values():
            _end(process)
        self._running.clear()

    def do(self, step: Step) -> None:
        """Let it happen."""
        if step.action in ("start", "restart"):
            self._running[step.robot] = self._start(step.robot)
        elif step.action in ("freeze", "thaw"):
            number = signal.SIGSTOP if step.action == "freeze" else signal.SIGCONT
            self._running[step.robot].send_signal(number)
        else:
            process = self._running.pop(step.robot)
            if step.action == "kill":
                process.kill()
            _end_input(process)
            _end(process)

    def _start(self, robot: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "beacon_gateway.console.robot"], stdin=subprocess.PIPE, text=True
        )
        assert process.stdin is not None  # noqa: S101 - it was asked for
        order = {"options": self._options, "hints": _hints(robot)}
        process.stdin.write(json.dumps(order) + "\n")
        process.stdin.flush()
        return process


def _hints(robot: str) -> list[dict[str, Any]]:
    return [
        {
            "entity_id": f"{robot}_{part}",
            "display_name": f"{name} of {robot}",
            "component_id": robot,
            "function_ids": [function],
            "depends_on": [f"{robot}_{needed}" for needed in needs],
            "process_name": f"{robot}d",
            "hostname": f"{robot}.example",
            "transport_type": "zenoh",
            "metadata": {"firmware": "1.2.3"},
        }
        for part, name, function, needs in _PARTS
    ]


def _end(process: subprocess.Popen[str]) -> None:
    try:
        process.wait(_CLOSE_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _end_input(process: subprocess.Popen[str]) -> None:
    with suppress(BrokenPipeError):
        if process.stdin is not None:
            process.stdin.close()
