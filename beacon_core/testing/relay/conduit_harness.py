"""What the conduits' suite needs of a carrier: a :class:`ConduitHarness`, written once for each.

The suite looks at a conduit through an :class:`End`: the conduit, and a :class:`Recorder` behind it
that writes down what came in, when, and whether two threads came at once.

Nothing here imports pytest, so a harness may also be used outside the suite.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import get_ident
from typing import Protocol

import attrs

from beacon_core.ports.conduit import Conduit
from beacon_core.testing.waiting import wait_until

__all__ = [
    "ConduitCapabilities",
    "ConduitHarness",
    "End",
    "RealTimeConduitHarness",
    "Recorder",
    "SentOnce",
]

SentOnce = tuple[bytes, bytes]
"""A frame: header and payload."""


@attrs.frozen
class ConduitCapabilities:
    """What a carrier can be made to do. What it cannot do is not tested, and shown as skipped."""

    ignores_own: bool = True
    """An end does not hear what it sends itself. The core does without, but pays for each frame."""
    breaks: bool = True
    """:meth:`ConduitHarness.cut` and ``mend`` work."""
    freezes: bool = True
    """:meth:`ConduitHarness.frozen` works: other ends may be processes of their own."""


class ConduitHarness(Protocol):
    """One carrier with ends on it that hear each other, made anew for each check.

    Thread rule: called from one thread.
    """

    @property
    def capabilities(self) -> ConduitCapabilities: ...

    @property
    def patience_s(self) -> float:
        """How long to wait for what must come. Only a failing check waits that long."""

    @property
    def quiet_s(self) -> float:
        """How long to listen before believing that nothing comes."""

    @property
    def waiting_bytes(self) -> int:
        """So much the carrier may keep in this process of what it cannot get rid of."""

    @property
    def hang_told_within_s(self) -> float:
        """So late it is told that the other end hangs while large frames are on their way."""

    def conduit(self) -> Conduit:
        """A new end, not started."""

    def cut(self) -> None:
        """Break the link between all ends, so that nothing gets through."""

    def mend(self) -> None:
        """Let it come back, by itself or not."""

    def frozen(self) -> AbstractContextManager[object]:
        """Within, the only other end, which is in a process of its own, is stopped as by SIGSTOP.

        It was linked with those of this process before.
        """

    def wait_until(self, predicate: Callable[[], bool], deadline_s: float) -> bool:
        """Let time pass until ``predicate()`` holds (``True``) or the deadline passed (``False``).

        Must look at once, and then often.
        """

    def close(self) -> None:
        """Close everything that was made here."""


class RealTimeConduitHarness:
    """The half of a :class:`ConduitHarness` that is the same for every real carrier.

    A subclass gives ``conduit``, and sets ``capabilities`` or gives ``cut``, ``mend``, ``frozen``.
    """

    capabilities: ConduitCapabilities = ConduitCapabilities(breaks=False, freezes=False)
    patience_s: float = 10.0
    quiet_s: float = 0.2
    waiting_bytes: int = 0
    hang_told_within_s: float = 2.0

    def cut(self) -> None:
        raise NotImplementedError

    def mend(self) -> None:
        raise NotImplementedError

    def frozen(self) -> AbstractContextManager[object]:
        raise NotImplementedError

    def wait_until(self, predicate: Callable[[], bool], deadline_s: float) -> bool:
        return wait_until(predicate, deadline_s, pause_s=0.002)

    def close(self) -> None:
        """For subclasses that have something to close."""


class Recorder:
    """A frame sink that writes down each call.

    ``hook``, if set, is run inside each call of ``frame``. Thread rule: as the sink's.
    """

    def __init__(self) -> None:
        self.hook: Callable[[], object] | None = None
        self.overlapped = False
        """Two threads were in it at once."""
        self.links: list[tuple[bool, float]] = []
        """What was told of the link, and when, in monotonic seconds."""
        self._frames: list[SentOnce] = []
        self._inside = 0

    @property
    def frames(self) -> list[SentOnce]:
        """What has come in so far, a copy."""
        return list(self._frames)

    @property
    def up(self) -> bool:
        """What was told of the link last."""
        return bool(self.links) and self.links[-1][0]

    def frame(self, header: bytes, payload: bytes) -> None:
        with self._called():
            self._frames.append((header, payload))
            if self.hook is not None:
                self.hook()

    def link(self, *, up: bool) -> None:
        with self._called():
            self.links.append((up, time.monotonic()))

    @contextmanager
    def _called(self) -> Iterator[None]:
        before, self._inside = self._inside, get_ident()
        self.overlapped |= before not in (0, self._inside)
        try:
            yield
        finally:
            self._inside = before


class End:
    """A conduit, and what it has told."""

    def __init__(self, conduit: Conduit) -> None:
        self.conduit = conduit
        self.sink = Recorder()

    def start(self) -> End:
        self.conduit.start(self.sink)
        return self

    def heard(self, frame: SentOnce) -> bool:
        """Has it come in, at least once?"""
        return frame in self.sink.frames
