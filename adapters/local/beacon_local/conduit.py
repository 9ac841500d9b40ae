"""Ends in one process, without a thread of their own.

Theory. Each end has an inbox. Who sends puts the frame into the inboxes of the others, and then
carries what is in them to their sinks, unless somebody is at that already: then it is theirs to
carry too. So a sink is called by one thread at a time, whoever sends never waits for another
sender, and a sink may send from inside its call: two ends that answer each other at once can
neither lock each other out nor call each other deeper and deeper.

A carrier that is kept at it by others loses what is left after ``_CARRY_S``: to lose is allowed, to
hold up who sends is not.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterable
from threading import get_ident

from beacon_core.errors import UsageError
from beacon_core.ports.conduit import ConduitLimits, FrameSink

__all__ = ["LocalConduit"]

_LIMITS = ConduitLimits(max_header_bytes=1024 * 1024, max_payload_bytes=64 * 1024 * 1024)
_INBOX_BYTES = 64 * 1024 * 1024
"""An inbox that holds more takes nothing: its sink is slower than who sends."""

_CARRY_S = 0.2
_CLOSE_WITHIN_S = 0.9

_Item = tuple[bytes, bytes] | bool
"""A frame, or what is told of the link."""

_lock = threading.Lock()
_ends: dict[str, list[LocalConduit]] = {}


class LocalConduit:
    """Implements :class:`beacon_core.ports.conduit.Conduit`; the thread rule is the port's.

    Frames between two ends come in order. ``send`` is done when the sinks are, if nobody else is
    calling them.
    """

    def __init__(self, name: str = "default") -> None:
        self._name = name
        self._sink: FrameSink | None = None
        self._closed = False
        self._others: tuple[LocalConduit, ...] = ()
        self._inbox: deque[_Item] = deque()
        self._inbox_bytes = 0
        self._counting = threading.Lock()
        self._carrying = threading.Lock()
        self._carrier = 0

    def start(self, sink: FrameSink) -> None:
        """Raises ``UsageError`` for a second start."""
        with _lock:
            if self._closed or self._sink is not None:
                raise UsageError("start: it was started or closed already; make a new one")
            self._sink = sink
            ends = _ends.setdefault(self._name, [])
            ends.append(self)
            _introduce(ends)
            met = tuple(ends)
        _carry_all(met)

    def send(self, header: bytes, payload: bytes) -> bool:
        limits = _LIMITS
        if len(header) > limits.max_header_bytes or len(payload) > limits.max_payload_bytes:
            return False
        others = self._others
        taken = [other.put(header, payload) for other in others]
        _carry_all(others)
        return any(taken)

    def limits(self) -> ConduitLimits:
        return _LIMITS

    def close(self) -> None:
        with _lock:
            self._closed = True
            self._others = ()
            ends = _ends.get(self._name, [])
            if self in ends:
                ends.remove(self)
                _introduce(ends)
            if not ends:
                _ends.pop(self._name, None)
            left = tuple(ends)
        _carry_all(left)
        self._wait_for_the_carrier()

    def put(self, header: bytes, payload: bytes) -> bool:
        """Into the inbox; called by another end."""
        with self._counting:
            if self._closed or self._inbox_bytes >= _INBOX_BYTES:
                return False
            self._inbox_bytes += len(header) + len(payload)
            self._inbox.append((header, payload))
        return True

    def carry(self) -> None:
        """Empty the inbox, unless somebody is at it: he looks again after he has let go.

        Called by other ends, in the order of their frames.
        """
        until = time.monotonic() + _CARRY_S
        while self._inbox and self._carrying.acquire(blocking=False):
            self._carrier = get_ident()
            try:
                self._empty(until)
            finally:
                self._carrier = 0
                self._carrying.release()

    def meet(self, others: tuple[LocalConduit, ...]) -> None:
        """These are the others now; called with the lock on all ends."""
        before, self._others = bool(self._others), others
        if before != bool(others):
            self._inbox.append(not before)

    def _empty(self, until: float) -> None:
        while self._inbox:
            item = self._inbox.popleft()
            if isinstance(item, bool):
                self._tell(item)
            elif time.monotonic() < until:
                self._hand_in(*item)
            else:
                self._forget(*item)

    def _hand_in(self, header: bytes, payload: bytes) -> None:
        self._forget(header, payload)
        if self._sink is not None and not self._closed:
            self._sink.frame(header, payload)

    def _forget(self, header: bytes, payload: bytes) -> None:
        with self._counting:
            self._inbox_bytes -= len(header) + len(payload)

    def _tell(self, up: bool) -> None:  # noqa: FBT001 - it is what the method is about
        if self._sink is not None and not self._closed:
            self._sink.link(up=up)

    def _wait_for_the_carrier(self) -> None:
        if self._carrier != get_ident() and self._carrying.acquire(timeout=_CLOSE_WITHIN_S):
            self._carrying.release()


def _introduce(ends: list[LocalConduit]) -> None:
    """Let each end know the others; it is told of the link when it gets its first or loses all."""
    for end in ends:
        end.meet(tuple(one for one in ends if one is not end))


def _carry_all(ends: Iterable[LocalConduit]) -> None:
    for end in ends:
        end.carry()
