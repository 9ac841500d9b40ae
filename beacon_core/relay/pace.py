"""So much per second, and a little at once: the bucket of a route, and that of the link.

Theory. A bucket is kept as one time: when all that has passed would be paid for at the given rate
(the "virtual scheduling" form of ITU-T I.371, annex A). Something may pass while that is no more
than ``slack`` ahead, whatever its size; it is paid for afterwards. So in any time ``t`` no more
passes than the rate gives in ``t + slack``, and the last one; and who finds the bucket empty waits
no longer than the one before it takes at the given rate.
"""

from __future__ import annotations

import math

__all__ = ["SLACK_NS", "Pace"]

SLACK_NS = 100 * 10**6
"""What may go at once where bytes are counted: a tenth of a second's worth."""


class Pace:
    """Thread rule: none of its own."""

    def __init__(self, per_s: float, slack_ns: int, now_ns: int) -> None:
        """``per_s`` is above 0; the bucket is full."""
        self._unit_ns = 1e9 / per_s
        self._slack_ns = slack_ns
        self._paid_ns = now_ns

    @property
    def free_ns(self) -> int:
        """From when on something may pass."""
        return self._paid_ns - self._slack_ns

    def spend(self, amount: int, now_ns: int) -> None:
        """So much passes, whether it may or not."""
        self._paid_ns = max(self._paid_ns, now_ns) + math.ceil(amount * self._unit_ns)
