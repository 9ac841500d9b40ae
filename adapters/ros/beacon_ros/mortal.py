"""An announcer in a process of its own, to be killed: for tests of what becomes of its hints.

The network misses a process that ended without a word after its lease, which is 20 s in ROS 2. Here
the child is given one of 1 s; whoever watches it needs nothing special.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cattrs

from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter, Malformed
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.health import Condition, Health
from beacon_core.wire import json as wire

__all__ = ["LEASE_S", "MortalAnnouncer", "short_lease"]

LEASE_S = 1.0
"""After so long without a sign of life a process is gone from the graph, measured 0.97 to 1.0."""


def short_lease() -> Mapping[str, str]:
    """Variables for the environment of a ROS process that shall be missed after ``LEASE_S``."""
    profile = str(Path(__file__).with_name("short_lease.xml"))
    # Fast DDS 2 (ROS 2 Jazzy) reads the first, Fast DDS 3 (Kilted) the second.
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
    return dict.fromkeys(names, profile)


class MortalAnnouncer:
    """Implements :class:`beacon_core.ports.announcer.Announcer`; thread rule: one thread.

    ``module`` is that of the adapter's package, which has it as ``ADAPTER``.
    """

    def __init__(self, module: str, options: Any, period_s: float | None = None) -> None:
        plain = json.dumps([module, cattrs.unstructure(options), period_s])
        self.process = subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-m", __name__, plain],
            stdin=subprocess.PIPE,
            env={**os.environ, **short_lease()},
        )

    def announce(self, hint: BeaconHint) -> None:
        self._tell("announce", wire.encode(hint).decode())

    def withdraw(self, entity_id: str) -> None:
        self._tell("withdraw", entity_id)

    def close(self) -> None:
        """Let it close its announcer, and wait for its end."""
        self.end(signal.SIGINT)

    def health(self) -> Health:
        """Of the process alone."""
        return Health(Condition.UP if self.process.poll() is None else Condition.CLOSED)

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Within, it stands still; it may be killed all the same."""
        self.process.send_signal(signal.SIGSTOP)
        yield
        self.process.send_signal(signal.SIGCONT)

    def end(self, number: signal.Signals) -> int:
        """Send the signal and wait. Returns the exit code."""
        assert self.process.stdin is not None  # noqa: S101 - for the type checker
        self.process.send_signal(number)
        code = self.process.wait(30)
        self.process.stdin.close()
        return code

    def _tell(self, *words: str) -> None:
        assert self.process.stdin is not None  # noqa: S101 - for the type checker
        self.process.stdin.write(json.dumps(words).encode() + b"\n")
        self.process.stdin.flush()


def _obey(announcer: Announcer, orders: Iterable[bytes | str]) -> None:
    """In the child: obey. Interrupted it closes; at the end of its orders it vanishes."""
    try:
        for order in orders:
            verb, text = json.loads(order)
            if verb == "withdraw":
                announcer.withdraw(text)
                continue
            announcement = wire.decode(text.encode())
            assert not isinstance(announcement, Malformed), announcement  # noqa: S101
            announcer.announce(announcement.hint)
    except KeyboardInterrupt:
        announcer.close()


def _main(plain: str) -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    module, options, period_s = json.loads(plain)
    adapter: Adapter = importlib.import_module(module).ADAPTER
    announcer = adapter.announcer(cattrs.structure(options, adapter.options), period_s)
    _obey(announcer, sys.stdin.buffer)
    # Whoever gave the orders is gone. Threads of ROS's that are left would make this an abort.
    os._exit(0)


if __name__ == "__main__":
    _main(sys.argv[1])
