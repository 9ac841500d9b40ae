"""The latest events, ready to send: whoever was away for a moment reads on where it stopped.

Every event is rendered once and kept here once, whatever the number of clients. A client is a
number: that of the last event it was given. So a slow one costs no more than a quick one, until
what it has not read falls out of the ring.
"""

from __future__ import annotations

import threading
from collections import deque
from itertools import accumulate, islice

import attrs

__all__ = ["MAX_RING_BYTES", "MAX_RING_FRAMES", "Frame", "Ring"]

MAX_RING_FRAMES = 10_000
"""Each entity of a full store once. ros2_medkit's stream of faults keeps 100."""

MAX_RING_BYTES = 8 * 1024 * 1024
"""What the frames may take together; a usual one has 0.7 kB."""


@attrs.frozen
class Frame:
    """One event as it is sent."""

    number: int
    entity_id: str
    """``""`` for an event that is about no entity."""
    data: bytes


class Ring:
    """Thread rule: every method may be called from any thread; none takes long."""

    def __init__(self, *, frames: int = MAX_RING_FRAMES, size: int = MAX_RING_BYTES) -> None:
        """It keeps at most so many, and at most so many bytes; the latest one in any case."""
        self._frames: deque[Frame] = deque()
        self._max_frames, self._max_bytes = frames, size
        self._bytes = 0
        self._joined: tuple[int, int, bytes] = (0, 0, b"")
        self._lock = threading.Lock()
        self.last = 0
        """The number of the latest event."""

    def append(self, frame: Frame) -> None:
        """The next event; its number is one above the last."""
        with self._lock:
            self._frames.append(frame)
            self._bytes += len(frame.data)
            self.last = frame.number
            while len(self._frames) > self._max_frames or (
                self._bytes > self._max_bytes and len(self._frames) > 1
            ):
                self._bytes -= len(self._frames.popleft().data)

    def reaches(self, number: int) -> bool:
        """Can whoever has this one read on?"""
        with self._lock:
            return self._reaches(number)

    def near(self, number: int) -> bool:
        """The same, and will it stay so until as much again has happened as is kept by half?"""
        with self._lock:
            return self._reaches(number) and self.last - number <= len(self._frames) // 2

    def after(self, number: int, at_most: int) -> tuple[bytes, int] | None:
        """The events after one, in one piece of about ``at_most`` bytes, and the number of the last
        of them; ``None`` if the ring does not reach it."""
        with self._lock:
            if not self._reaches(number):
                return None
            if self._joined[0] == number < self._joined[1]:
                # Clients that keep up all ask for the same.
                return self._joined[2], self._joined[1]
            frames = _first_of(self._since(number), at_most)
            last = frames[-1].number if frames else number
            self._joined = (number, last, b"".join(frame.data for frame in frames))
            return self._joined[2], last

    def entities_after(self, number: int) -> list[str] | None:
        """Whom the events after one are about, each once; ``None`` as in :meth:`after`."""
        with self._lock:
            if not self._reaches(number):
                return None
            named = (frame.entity_id for frame in self._since(number))
            return [entity_id for entity_id in dict.fromkeys(named) if entity_id]

    def _reaches(self, number: int) -> bool:
        return self.last - len(self._frames) <= number <= self.last

    def _since(self, number: int) -> list[Frame]:
        return list(islice(reversed(self._frames), self.last - number))[::-1]


def _first_of(frames: list[Frame], at_most: int) -> list[Frame]:
    """As many as fit, but at least one."""
    sizes = accumulate(len(frame.data) for frame in frames)
    return [frame for frame, size in zip(frames, sizes, strict=True) if size <= at_most] or frames[
        :1
    ]
