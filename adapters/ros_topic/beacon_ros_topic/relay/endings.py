"""Publishers that are ending: each is given time to have its last messages acknowledged.

What comes after on the same topic waits for that: DDS has one type for a topic in a process, and
the messages of one publisher are to arrive before those of the next.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from beacon_core.relay.marks import Mark
from beacon_ros_topic.relay.offer import Offer
from beacon_ros_topic.relay.voice import Voice

__all__ = ["Endings"]

_WITHIN_S = 0.4
"""Less than a republisher waits for a new publisher to be matched."""

_STEP_S = 0.005


class Endings:
    """Thread rule: one thread."""

    def __init__(self) -> None:
        self._ending: dict[str, tuple[Offer, float]] = {}
        # By topic, with the time by which it must end.
        self._waiting: dict[str, deque[Callable[[], object]]] = {}

    def after(self, topic: str, action: Callable[[], object]) -> None:
        """Do this now, or once what is ending on the topic has ended."""
        if topic in self._ending:
            self._waiting.setdefault(topic, deque()).append(action)
        else:
            action()

    def begin(self, offer: Offer) -> None:
        """Let it end; nothing is published by it any more."""
        self._ending[offer.what.topic] = (offer, time.monotonic() + _WITHIN_S)

    def offers(self) -> list[Offer]:
        """Those that have not ended yet."""
        return [offer for offer, _ in self._ending.values()]

    def step(
        self, sibling: Callable[[Offer, Mark], Voice], ended: Callable[[Offer], object]
    ) -> float | None:
        """See to them; gives the seconds until it is to be called again, ``None`` if not at all.

        ``sibling`` is for :meth:`.Offer.flush`; ``ended`` is told of each whose time has come.
        """
        for topic, (offer, until_s) in list(self._ending.items()):
            if time.monotonic() >= until_s or _done(offer, sibling):
                del self._ending[topic]
                ended(offer)
                self._go_on(topic)
        return _STEP_S if self._ending else None

    def _go_on(self, topic: str) -> None:
        waiting = self._waiting.pop(topic, deque())
        while waiting:
            waiting.popleft()()
            if topic in self._ending:
                self._waiting[topic] = waiting
                return


def _done(offer: Offer, sibling: Callable[[Offer, Mark], Voice]) -> bool:
    try:
        return not offer.flush(sibling) and offer.acknowledged()
    except Exception:  # noqa: BLE001 - ROS's are of many kinds, none of them public
        return True  # what cannot be said any more is not waited for
