"""The publishers of a republisher's lanes: made, given to the next type, and ended."""

from __future__ import annotations

from beacon_core.relay.alarms import Alarms
from beacon_core.relay.effects import CreatePublisher, DestroyPublisher, Effect, Publish
from beacon_core.relay.frames import Content
from beacon_core.relay.lane import Cause, Lane
from beacon_core.relay.settings import Republishing
from beacon_core.relay.track import Track

__all__ = ["Publishers"]


class Publishers:
    """Writes what is to be done into ``effects``, and when a lane is due into ``alarms``.

    Thread rule: none of its own.
    """

    def __init__(
        self, settings: Republishing, alarms: Alarms[tuple[str, int, int]], effects: list[Effect]
    ) -> None:
        self._settings, self._alarms, self._effects = settings, alarms, effects
        self._lanes: dict[int, Lane] = {}
        # By handle.
        self._last = 0

    def lane_of(self, handle: int) -> Lane | None:
        """Whose publisher it is; ``None`` if it is gone."""
        return self._lanes.get(handle)

    def provide(self, lane: Lane, head: Track, now_ns: int) -> None:
        """Have the publisher that the head needs; unless it failed, and is to rest."""
        if lane.offers != (head.advertised.type, head.advertised.qos):
            self.destroy(lane)
            self.create(lane, head, now_ns)

    def create(self, lane: Lane, head: Track, now_ns: int) -> None:
        """Make it, and let it wait for those who are to hear it."""
        self._last += 1
        lane.handle, lane.offers = self._last, (head.advertised.type, head.advertised.qos)
        self._lanes[lane.handle] = lane
        lane.move(Cause.MADE, now_ns)
        self._effects.append(CreatePublisher(lane.handle, lane.name, *lane.offers, lane.origin))
        delay_ns = self._settings.advertise_delay_ns
        wait_ns = self._settings.match_ns if delay_ns is None else delay_ns
        if wait_ns:
            self._alarms.set(("lane", lane.number, 0), now_ns + wait_ns)
        else:
            lane.move(Cause.WAITED, now_ns)

    def publish(self, lane: Lane, content: Content) -> bool:
        """``False`` if there is no publisher."""
        if lane.handle is None:
            return False
        self._effects.append(
            Publish(lane.handle, content.payload, content.stamp_ns, content.first, content.hop + 1)
        )
        return True

    def fail(self, lane: Lane, reason: str, now_ns: int) -> None:
        """It is gone; the lane is to try again later."""
        self._forget(lane)
        lane.move(Cause.FAILED, now_ns, reason)
        self._alarms.set(("lane", lane.number, 0), now_ns + self._settings.retry_ns)

    def destroy(self, lane: Lane) -> None:
        """End it, if there is one."""
        self._alarms.cancel(("lane", lane.number, 0))
        if lane.handle is not None:
            self._effects.append(DestroyPublisher(lane.handle))
        self._forget(lane)

    def _forget(self, lane: Lane) -> None:
        if lane.handle is not None:
            del self._lanes[lane.handle]
            lane.handle = None
