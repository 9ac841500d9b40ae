"""Every source's carrier looked at, side by side, however long some adapter takes over it."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import attrs

from beacon_core.errors import BeaconError
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.examination import Finding, Level
from beacon_gateway.adapters import load_adapter
from beacon_gateway.config import Config, Lookup, SourceConfig

__all__ = ["PATIENCE_S", "Checkup", "check_up"]

PATIENCE_S = 10.0
"""How much longer than asked to look an examination may take, for connecting and for asking."""

_WAKE_S = 0.2
"""Between two looks at a thread, so that Ctrl-C is heard."""


@attrs.frozen
class Checkup:
    """What was found about one source."""

    name: str
    adapter: str
    findings: tuple[Finding, ...]


def check_up(
    config: Config,
    seconds: float,
    *,
    lookup: Lookup = load_adapter,
    patience_s: float = PATIENCE_S,
) -> Iterator[Checkup]:
    """The configured sources in their order, each as soon as it is through.

    All are examined from the first ``next`` on. One that is not through in time is given up, with
    what it had found until then.
    """
    began = time.monotonic()
    running = [
        _Examination(name, source, lookup(source.adapter), seconds)
        for name, source in config.sources.items()
    ]
    for one in running:
        one.thread.start()
    for one in running:
        yield one.outcome(began + seconds + patience_s)


class _Examination:
    """One source's, in a thread that nobody waits for longer than agreed."""

    def __init__(self, name: str, source: SourceConfig, adapter: Adapter, seconds: float) -> None:
        self._name = name
        self._adapter = adapter
        self._options = source.options
        self._seconds = seconds
        self._found: list[Finding] = []
        self._began = time.monotonic()
        self.thread = threading.Thread(target=self._run, name=f"beacon-doctor-{name}", daemon=True)

    def outcome(self, deadline: float) -> Checkup:
        """What was found until it ended, or until the deadline."""
        while self.thread.is_alive() and (left := deadline - time.monotonic()) > 0:
            self.thread.join(min(left, _WAKE_S))
        # In this order: nothing can be added any more to what an ended thread has found.
        given_up = self.thread.is_alive()
        found = tuple(self._found)
        if given_up:
            found += (self._unfinished(),)
        return Checkup(self._name, self._adapter.name, found)

    def _run(self) -> None:
        try:
            for finding in self._look():
                self._found.append(_checked(finding))
        except BeaconError as error:
            self._found.append(Finding(Level.PROBLEM, str(error)))
        except Exception as error:  # noqa: BLE001 - whatever somebody else's adapter raises
            self._found.append(self._failed(error))

    def _look(self) -> Iterator[Finding]:
        # As a gateway would begin: what is refused there is the first thing to know.
        self._adapter.source(self._options).close()
        if self._adapter.examine is None:
            yield Finding(
                Level.NOTE,
                f"the adapter {self._adapter.name!r} offers no examination",
                "see what a running gateway says of it",
            )
            return
        yield from self._adapter.examine(self._options, self._seconds)

    def _failed(self, error: Exception) -> Finding:
        return Finding(
            Level.PROBLEM,
            f"the examination failed: {type(error).__name__}: {error}",
            f"a defect of the adapter {self._adapter.name!r}: please report it",
        )

    def _unfinished(self) -> Finding:
        return Finding(
            Level.PROBLEM,
            f"the examination was not through after {time.monotonic() - self._began:.0f} s",
            "what comes above was found until then; something of the carrier may hang",
        )


def _checked(finding: object) -> Finding:
    if isinstance(finding, Finding):
        return finding
    raise TypeError(f"{finding!r} is no Finding")
