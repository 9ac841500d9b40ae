"""A conduit for tests that keeps the port's promises, with a cable between its ends to play with.

As on the other networks of this package nothing happens by itself: a frame is on the cable until
somebody calls :meth:`FakeCable.deliver`. What becomes of the link is told at once.
"""

from __future__ import annotations

import threading

import attrs

from beacon_core.errors import UsageError
from beacon_core.ports.conduit import ConduitLimits, FrameSink

__all__ = ["FakeCable", "FakeEnd"]

_DEFAULT_LIMITS = ConduitLimits(max_header_bytes=128 * 1024, max_payload_bytes=16 * 1024 * 1024)


@attrs.frozen
class _UnderWay:
    header: bytes
    payload: bytes
    to: FakeEnd


class FakeCable:
    """What ends are plugged into. Thread rule: any thread; sinks are called under one lock."""

    def __init__(
        self, limits: ConduitLimits = _DEFAULT_LIMITS, most_bytes: int = 64 * 1024 * 1024
    ) -> None:
        """``most_bytes`` on the cable at a time; what is more is refused."""
        self.limits = limits
        self.lost = 0
        """Frames that were accepted and did not get through."""
        self._most_bytes = most_bytes
        self._bytes = 0
        self._under_way: list[_UnderWay] = []
        self._ends: list[FakeEnd] = []
        self._whole = True
        # A sink may send, and close its end, from inside its call.
        self._lock = threading.RLock()

    def __len__(self) -> int:
        """Frames under way, once for each end that they are for."""
        return len(self._under_way)

    def end(self) -> FakeEnd:
        """A new end, not started."""
        return FakeEnd(self)

    def deliver(self, at: int = 0, *, keep: bool = False) -> bool:
        """Let the frame at this place through; ``keep`` it too, to come again. Wraps round.

        ``False`` if nothing was under way.
        """
        with self._lock:
            if not self._under_way:
                return False
            at %= len(self._under_way)
            one = self._under_way[at] if keep else self._take(at)
            one.to.hand_in(one.header, one.payload)
            return True

    def deliver_all(self) -> int:
        """Let all through that is under way now, in order; returns how many frames that were."""
        count = len(self)
        for _ in range(count):
            self.deliver()
        return count

    def lose(self, at: int = 0, count: int = 1) -> None:
        """Lose so many from this place on."""
        with self._lock:
            for _ in range(min(count, len(self) - at)):
                self._take(at)
                self.lost += 1

    def cut(self) -> None:
        """Cut it: what is under way is lost, and no end reaches another one."""
        with self._lock:
            self.lose(0, len(self))
            self._whole = False
            self._tell()

    def mend(self) -> None:
        """Mend it."""
        with self._lock:
            self._whole = True
            self._tell()

    def plug(self, end: FakeEnd) -> None:
        """Called by an end that starts."""
        with self._lock:
            self._ends.append(end)
            self._tell()

    def unplug(self, end: FakeEnd) -> None:
        """Called by an end that closes. Idempotent."""
        with self._lock:
            if end in self._ends:
                self._ends.remove(end)
            self._tell()

    def send(self, header: bytes, payload: bytes, sender: FakeEnd) -> bool:
        """Called by an end."""
        limits, size = self.limits, len(header) + len(payload)
        if len(header) > limits.max_header_bytes or len(payload) > limits.max_payload_bytes:
            return False
        with self._lock:
            others = self._others(sender)
            if not others or self._bytes + size * len(others) > self._most_bytes:
                return False
            self._under_way += [_UnderWay(header, payload, other) for other in others]
            self._bytes += size * len(others)
            return True

    def _others(self, end: FakeEnd) -> list[FakeEnd]:
        if not self._whole or end not in self._ends:
            return []
        return [one for one in self._ends if one is not end]

    def _take(self, at: int) -> _UnderWay:
        one = self._under_way.pop(at)
        self._bytes -= len(one.header) + len(one.payload)
        return one

    def _tell(self) -> None:
        for end in list(self._ends):
            end.tell(up=bool(self._others(end)))


class FakeEnd:
    """Implements :class:`beacon_core.ports.conduit.Conduit`; made by :meth:`FakeCable.end`."""

    def __init__(self, cable: FakeCable) -> None:
        self._cable = cable
        self._sink: FrameSink | None = None
        self._up = False
        self._closed = False

    def start(self, sink: FrameSink) -> None:
        """Raises ``UsageError`` for a second start."""
        if self._closed or self._sink is not None:
            raise UsageError("start: it was started or closed already; make a new one")
        self._sink = sink
        self._cable.plug(self)

    def send(self, header: bytes, payload: bytes) -> bool:
        return self._cable.send(header, payload, self)

    def limits(self) -> ConduitLimits:
        return self._cable.limits

    def close(self) -> None:
        self._closed = True
        # Waits for whoever is in our sink.
        self._cable.unplug(self)

    def hand_in(self, header: bytes, payload: bytes) -> None:
        """Called by the cable, under its lock."""
        if self._sink is not None and not self._closed:
            self._sink.frame(header, payload)

    def tell(self, *, up: bool) -> None:
        """Called by the cable, under its lock."""
        if up != self._up and self._sink is not None and not self._closed:
            self._up = up
            self._sink.link(up=up)
