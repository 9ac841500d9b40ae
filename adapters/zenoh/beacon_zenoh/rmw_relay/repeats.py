"""Messages that come twice, told from those that do not.

It happens when another session takes the place of ours, for a moment, and from what a publisher
keeps, whenever it is asked again. Either way it is known by what stands beside it. The publishers
of one topic may have been thousands over the years, and its messages any number: both are bounded.
"""

from __future__ import annotations

__all__ = ["Numbers", "Stamps"]

_WINDOW = 1024
"""Numbers of one publisher: 10 ms of what a topic can take at the most are 400."""
_ONES = (1 << _WINDOW) - 1

_MAX_PUBLISHERS = 1_000
_MAX_STAMPS = 4_096
"""Four times what is kept at the most."""


class Numbers:
    """Of each publisher those that were heard of late, as bits below the highest.

    They may be out of order: two threads that share a publisher can overtake each other.
    """

    def __init__(self) -> None:
        self._heard: dict[bytes, tuple[int, int]] = {}

    def is_new(self, gid: bytes, number: int) -> bool:
        """Is it heard for the first time? 0 is "not given", which is always new."""
        if not number:
            return True
        highest, bits = self._heard.get(gid, (number, 0))
        if number > highest:
            shift = number - highest
            bits = (bits << shift) & _ONES if shift < _WINDOW else 0
            highest = number
        bit = 1 << (highest - number) if highest - number < _WINDOW else 0
        if not bit or bits & bit:
            return False
        self._heard[gid] = highest, bits | bit
        if len(self._heard) > _MAX_PUBLISHERS:
            del self._heard[next(iter(self._heard))]
        return True


class Stamps:
    """Of a topic whose publishers keep what they said. By the stamp that a message was given for
    Zenoh it is known also when its publisher has another GID by now, on another session."""

    def __init__(self) -> None:
        self._heard: dict[str, None] = {}

    def is_new(self, stamp: str) -> bool:
        """Is it heard for the first time?"""
        if stamp in self._heard:
            return False
        self._heard[stamp] = None
        if len(self._heard) > _MAX_STAMPS:
            del self._heard[next(iter(self._heard))]
        return True
