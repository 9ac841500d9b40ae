"""When to look at the ROS graph.

Theory. The middleware says when a publisher that can be heard comes or goes, and when one comes
that cannot, for its QoS. It does not say when that one goes, nor that one comes with another type;
and the graph may lag behind what it says, with a publisher's node named only 100 ms later. So the
graph is looked at once something is said and some times after, and now and then without a word.

A look costs: 60 microseconds per publisher, in the thread that also takes the messages. However
often publishers come and go, looks take a tenth of that thread's time at most, and where nothing
is said a two-hundredth.
"""

from __future__ import annotations

__all__ = ["Looks"]

_AFTER_S = (0.0, 0.1, 0.5)
"""After something was said."""

_EVERY_S = 2.0

_BUSY_SHARE = 0.1
_IDLE_SHARE = 0.005


class Looks:
    """Times are seconds of a clock that does not jump. Thread rule: one thread."""

    def __init__(self, now_s: float) -> None:
        """The first one is due now."""
        self._earliest_s = self._latest_s = now_s
        self._wanted_s: list[float] = []

    def soon(self, now_s: float) -> None:
        """Something was said."""
        self._wanted_s = [now_s + after_s for after_s in _AFTER_S]

    def wait_s(self, now_s: float) -> float:
        """Until the next one is due; 0 if it is."""
        next_s = min([self._latest_s, *self._wanted_s])
        return max(0.0, max(next_s, self._earliest_s) - now_s)

    def looked(self, began_s: float, now_s: float) -> None:
        """One was taken, which began and ended then."""
        took_s = now_s - began_s
        self._wanted_s = [due_s for due_s in self._wanted_s if due_s > began_s]
        self._earliest_s = began_s + took_s / _BUSY_SHARE
        self._latest_s = began_s + max(_EVERY_S, took_s / _IDLE_SHARE)
