"""Stamps, and how far to believe them.

A stamp says when the sender spoke, by the sender's wall clock; the store wants to know the same on
our monotonic clock. If both wall clocks agree, ``age = wall now - stamp`` and the message was sent
at ``monotonic now - age`` (back-projection; a stamp in the future counts as "just now"). If they do
not agree (simulated time, no NTP, a dead battery), the same sum gives nonsense: a robot that is
plainly talking would count as dead for years.

Delay and clock error cannot be told apart in one message. Over several, the smallest difference
ever seen is the best estimate of the clock error, since delay only adds to it; that is the measured
``offset`` of a source (positive: its clock is behind ours).
"""

from __future__ import annotations

import enum

__all__ = ["TOLERATED_OFFSET_NS", "ClockOffset", "SkewPolicy", "trusted_age_ns"]

TOLERATED_OFFSET_NS = 1_000_000_000
"""A clock that is off by more than this is reported. NTP keeps to milliseconds; a second is more
than a LAN's delay and less than any time to live."""

_WINDOW = 64
"""Stamps per window. Two windows are kept, so a clock that drifts is followed in 128 messages."""

_ENOUGH = 3
"""Stamps before a difference is called skew: a single old message is more often a late one."""

_CONVINCING = 4
"""Stamps in a row that make another offset believed. At a beat of 2 s a robot whose clock was set
is heard again before the usual ttl of 10 s is over, whatever its stamps said in between."""


class SkewPolicy(enum.StrEnum):
    """What a stamp may decide."""

    STAMP = "stamp"
    """Always believe it, as ros2_medkit does: a source with a wrong clock may never be visible."""
    ARRIVAL = "arrival"
    """Never believe it: a hint is as old as its arrival. Replayed old messages look fresh."""
    AUTO = "auto"
    """Believe it as far as the source's clock is known: a measured offset is taken off. Before one
    is measured, a stamp that would make the hint invisible (older than ``expiry``) is not believed.
    """


class ClockOffset:
    """The measured clock offset of one source: the smallest difference lately seen.

    A clock that is set shows in each stamp from then on, a late or repeated message in a few. So
    when some stamps in a row agree with each other, and not with the offset, they are a new offset.

    Thread rule: none of its own; the owner holds a lock.
    """

    __slots__ = ("_agreeing", "_count", "_earlier_ns", "_elsewhere_ns", "_smallest_ns")

    def __init__(self) -> None:
        self._count = 0
        self._smallest_ns = 0
        self._earlier_ns: int | None = None
        self._agreeing = 0
        # So many stamps in a row agree, within the tolerance, with the first of them.
        self._elsewhere_ns = 0

    def observe(self, stamp_ns: int, wall_now_ns: int) -> None:
        """Take one stamp into account that arrived at ``wall_now_ns``."""
        difference = wall_now_ns - stamp_ns
        if self._count == _WINDOW:
            self._earlier_ns, self._count = self._smallest_ns, 0
        if self._count == 0 or difference < self._smallest_ns:
            self._smallest_ns = difference
        self._count += 1
        if difference - (self.offset_ns or 0) > TOLERATED_OFFSET_NS:
            self._note_disagreement(difference)
        else:
            self._agreeing = 0

    def _note_disagreement(self, difference: int) -> None:
        if self._agreeing and abs(difference - self._elsewhere_ns) <= TOLERATED_OFFSET_NS:
            self._agreeing += 1
        else:
            self._agreeing, self._elsewhere_ns = 1, difference
        if self._agreeing == _CONVINCING:
            self._smallest_ns, self._earlier_ns = difference, None
            self._count, self._agreeing = _CONVINCING, 0

    @property
    def offset_ns(self) -> int | None:
        """Nanoseconds the source's clock is behind ours; ``None`` before the first stamp."""
        if self._count == 0:
            return None
        if self._earlier_ns is None:
            return self._smallest_ns
        return min(self._smallest_ns, self._earlier_ns)

    @property
    def measured(self) -> bool:
        """There were enough stamps to tell a wrong clock from a late message."""
        return self._count >= _ENOUGH or self._earlier_ns is not None

    @property
    def skewed(self) -> bool:
        """The clock is measured, and off by more than ``TOLERATED_OFFSET_NS`` either way."""
        offset = self.offset_ns
        return self.measured and offset is not None and abs(offset) > TOLERATED_OFFSET_NS


def trusted_age_ns(
    age_ns: int, clock: ClockOffset, expiry_ns: int, policy: SkewPolicy
) -> int | None:
    """The age to give a message whose stamp says ``age_ns`` (our wall clock less the stamp).

    ``clock`` has taken this stamp into account already. A stamp in the future says "just now": 0.
    ``None``: the policy does not believe the stamp, and the message counts as sent on arrival.
    """
    if policy is SkewPolicy.ARRIVAL:
        return None
    if policy is SkewPolicy.AUTO:
        if age_ns >= expiry_ns and not clock.measured:
            return None
        if clock.skewed:
            age_ns -= clock.offset_ns or 0
    return max(0, age_ns)
