"""What a republisher asks for, and when: nothing without a link, and seldom what does not come."""

from __future__ import annotations

from beacon_core.relay.alarms import Alarms
from beacon_core.relay.effects import Effect, Send
from beacon_core.relay.frames import MAX_WANTED, Reset, encode
from beacon_core.relay.greeting import Greeting, pause_ns
from beacon_core.relay.peer import Peer
from beacon_core.relay.settings import Republishing
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode

__all__ = ["HELLO", "Asking"]

_Key = tuple[str, int, int]

HELLO: _Key = ("hello", 0, 0)
"""The alarm for the next hello. Those of peers and tracks bear their origin and route."""


class Asking:
    """Writes resets into ``effects``, and when to ask again into ``alarms``.

    Thread rule: none of its own.
    """

    def __init__(
        self,
        asker: int,
        settings: Republishing,
        alarms: Alarms[_Key],
        effects: list[Effect],
        now_ns: int,
    ) -> None:
        self.linked = False
        self._asker, self._settings = asker, settings
        self._alarms, self._effects = alarms, effects
        self.greeting = Greeting(settings, now_ns)
        self._stalls: dict[_Key, tuple[int, int]] = {}
        # By gap alarm: the cursor that stands still, and how far the forwarder had come by then.

    def need_hello(self, now_ns: int) -> None:
        """Somebody is not known, or not as he is: say hello, as soon as it may be said."""
        if not self.linked:
            return
        if now_ns < self.greeting.free_ns:
            self._alarms.set_if_none(HELLO, self.greeting.free_ns)
            return
        self._send(Reset(0, 0, self._asker, hello=self.greeting.say(now_ns)))
        if not self.greeting.tired:
            self._alarms.set(HELLO, self.greeting.free_ns)

    def greeted(self) -> None:
        """Somebody has told all that he has."""
        self.greeting.answered()
        self._alarms.cancel(HELLO)

    def ask_new(self, peer: Peer, now_ns: int) -> None:
        """Ask for the advertisements that were not asked for yet."""
        new = [route for route, asks in peer.wanted.items() if not asks]
        if new and self.linked:
            peer.want_asks = 0
            self.ask_wanted(peer, new, now_ns)

    def ask_wanted(self, peer: Peer, routes: list[int], now_ns: int) -> None:
        """Ask for these, and for whatever is missing by then after a while."""
        for at in range(0, len(routes), MAX_WANTED):
            some = tuple(routes[at : at + MAX_WANTED])
            self._send(Reset(peer.origin, peer.epoch, self._asker, wanted=some))
        for route in routes:
            peer.wanted[route] += 1
        due_ns = now_ns + pause_ns(self._settings, peer.want_asks)
        peer.want_asks += 1
        self._alarms.set(("want", peer.origin, 0), due_ns)

    def ask_for(self, peer: Peer, track: Track, now_ns: int) -> None:
        """Ask for the first contents that a track misses."""
        ranges = track.missing(self._settings.ask_window)
        track.outstanding = {
            seq for one in ranges for seq in range(one.start, one.start + one.count)
        }
        self._send(Reset(peer.origin, peer.epoch, self._asker, ranges=ranges))
        due_ns = now_ns + pause_ns(self._settings, track.asks)
        track.asks += 1
        self._alarms.set(("ask", peer.origin, track.advertised.route), due_ns)

    def care_for(self, origin: int, track: Track, now_ns: int, *, stands_still: bool) -> None:
        """See that what is missing is asked for, and not waited for too long."""
        if not self.linked:
            return
        route = track.advertised.route
        if track.mode is not Mode.BEST_EFFORT and track.is_missing():
            self._alarms.set_if_none(("ask", origin, route), now_ns + self._settings.ask_after_ns)
        else:
            self._alarms.cancel(("ask", origin, route))
        gap: _Key = ("gap", origin, route)
        if not stands_still:
            self._alarms.cancel(gap)
            self._stalls.pop(gap, None)
        elif gap not in self._stalls or self._stalls[gap][0] != track.cursor:
            self._stalls[gap] = (track.cursor, track.next)
            self._alarms.set(gap, now_ns + self._settings.gap_ns)

    def waited_before(self, origin: int, route: int) -> int:
        """A gap has been waited for long enough: below this number, it is to be given up."""
        return self._stalls.pop(("gap", origin, route))[1]

    def rest(self, origin: int, route: int) -> None:
        """Ask for nothing more of this track, and wait for nothing."""
        self._alarms.cancel(("ask", origin, route))
        self._alarms.cancel(("gap", origin, route))
        self._stalls.pop(("gap", origin, route), None)

    def _send(self, reset: Reset) -> None:
        self._effects.append(Send(*encode(reset)))
