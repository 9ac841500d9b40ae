"""What a forwarder has sent in one of its lives, and so what it must send, and may not."""

from __future__ import annotations

from collections import Counter, deque

from beacon_core.relay.effects import Effect, Send
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.frames import CONTENT, HEAD, KIND_AT, Advertisement, Digest, Reset, decode
from beacon_core.relay.outlet import PATIENCE
from beacon_core.relay.route import Route
from beacon_core.relay.settings import Forwarding
from beacon_core.relay.shaping import Shaping
from beacon_core.relay.values import Mode

__all__ = ["Watch"]

_NEVER_NS = -(10**18)


class Watch:
    """Is told all that goes into a forwarder and comes out, and looks at its routes."""

    def __init__(
        self, core: Forwarder, place: tuple[int, int], forwarding: Forwarding, shaping: Shaping
    ) -> None:
        self._routes: dict[int, Route] = core._routes
        self._outlet = core._outlet
        self._place, self._settings = place, forwarding
        self._ages = shaping.max_age_ns is not None
        self._linked = False
        self._told_ns: dict[int, int] = {}
        self._sent_ns: dict[tuple[int, int], int] = {}
        self._spoken: dict[int, int] = {}
        # By route: numbers below it are out, or were taken without a link.
        paces = (shaping.rate_hz, shaping.bytes_per_s, shaping.max_age_ns)
        self._ranks = (
            forwarding.link_bytes_per_s is not None
            and forwarding.hold_bytes >= 10**6
            and paces == (None, None, None)
        )
        self._queues: dict[int, deque[int]] = {}
        self._priorities: dict[int, int] = {}
        self._murky = False
        # Something was asked for again, and waits among the new ones.
        self._since_lower = self._over = self._top = 0
        self._overtaken: dict[int, Counter[int]] = {}
        self.met: set[str] = set()

    # -- what goes in

    def linked(self, *, up: bool) -> None:
        """To be called after the forwarder was told."""
        self._linked = up
        if not up:
            self._spoken = {number: one.history.next for number, one in self._routes.items()}
            self._queues.clear()
            self._count_anew()

    def took(self, number: int, seq: int) -> None:
        """A message was numbered; to be called before what came of it is looked at."""
        route = self._routes[number]
        if not self._linked:
            self._spoken[number] = seq + 1
        elif self._ranks and route.shaped:
            self._priorities[number] = route.ruling.shaping.priority
            queue = self._queues.setdefault(number, deque(maxlen=min(route.history.most, 10**6)))
            queue.append(seq)

    def owed(self, header: bytes, payload: bytes, now_ns: int) -> set[int]:
        """The routes of which a question must be answered that its contents are gone."""
        reset = decode(header, payload)
        if not isinstance(reset, Reset) or not self._linked:
            return set()
        if (reset.origin, reset.epoch) != self._place or not reset.ranges:
            return set()
        self._murky = True
        return {
            one.route
            for one in reset.ranges
            if one.route in self._routes
            and one.start < self._routes[one.route].history.low
            and now_ns - self._told_ns.get(one.route, _NEVER_NS) >= self._settings.answer_gap_ns
        }

    # -- what comes out

    def answers(self, effects: list[Effect], owed: set[int], now_ns: int) -> None:
        """To a frame: whoever asks for what is gone is told so; nothing is told too often."""
        for effect in effects:
            if not isinstance(effect, Send) or not _is_control(effect):
                continue
            frame = decode(effect.header, effect.payload)
            if isinstance(frame, Advertisement):
                owed.discard(frame.route)
                told_ns = self._told_ns.get(frame.route, _NEVER_NS)
                assert now_ns - told_ns >= self._settings.answer_gap_ns
        assert not owed

    def sent(self, effect: Send, now_ns: int) -> None:
        """Each frame, in its order."""
        if not _is_control(effect):
            self._content(effect.header, now_ns)
            return
        frame = decode(effect.header, effect.payload)
        if isinstance(frame, Advertisement):
            self._told_ns[frame.route] = now_ns
            self._told(frame.route, frame.low, frame.next)
        elif isinstance(frame, Digest):
            for one in frame.entries:
                self._told(one.route, one.low, one.next)

    def settled(self) -> None:
        """A call is over."""
        if self._queues.keys() - self._routes.keys():
            for number in self._queues.keys() - self._routes.keys():
                del self._queues[number]
            self._count_anew()
        if self._murky and not self._outlet._waits:
            self._murky = False
            self._count_anew()

    def check(self) -> None:
        """Of best effort nothing is kept that is out."""
        for number, route in self._routes.items():
            if route.mode is Mode.BEST_EFFORT and len(route.history):
                assert (number, route.history.low) not in self._sent_ns

    # -- each kind of frame

    def _told(self, number: int, low: int, after: int) -> None:
        """What waits is not announced; but all of a route that is closed."""
        route = self._routes.get(number)
        if route is None:
            return
        if route.closed:
            assert after == route.history.next
        elif not self._ages:
            assert after <= max(low, self._spoken.get(number, 0))

    def _content(self, header: bytes, now_ns: int) -> None:
        _, _, _, _, _, _, number, seq, _, _ = HEAD.unpack(header)
        before_ns = self._sent_ns.get((number, seq))
        if before_ns is not None:
            assert now_ns - before_ns >= self._settings.resend_gap_ns
            route = self._routes.get(number)
            assert route is None or route.mode is not Mode.BEST_EFFORT
        self._sent_ns[number, seq] = now_ns
        self._spoken[number] = max(self._spoken.get(number, 0), seq + 1)
        if self._ranks:
            self._rank(number, seq)

    # -- priorities

    def _rank(self, number: int, seq: int) -> None:
        """Which of those that wait may go first, and how often a lower one goes instead."""
        waiting = {self._priorities[one] for one, queue in self._queues.items() if queue}
        queue = self._queues.get(number)
        if queue and seq in queue:
            while queue and queue[0] <= seq:
                queue.popleft()
        if self._murky or number not in self._priorities:
            self._since_lower += 1
            return
        mine = self._priorities[number]
        if any(one > mine for one in waiting):
            self.met.add("a lower one goes first")
            assert self._since_lower >= PATIENCE - 1
            self._since_lower = self._over = 0
        else:
            self._since_lower += 1
            # Where those before it are all out, it has been one of the lower ones until now.
            over = self._over if mine >= self._top else 0
            self._over = over + 1 if any(one < mine for one in waiting) else 0
            assert self._over < PATIENCE
        self._top = mine
        self._note_overtaken(mine, waiting)

    def _note_overtaken(self, mine: int, waiting: set[int]) -> None:
        """Between two of a class that waits, at most one of each lower class."""
        for one in self._overtaken.keys() - waiting:
            del self._overtaken[one]
        self._overtaken.pop(mine, None)
        for one in waiting:
            if one > mine:
                self._overtaken.setdefault(one, Counter())[mine] += 1
                assert self._overtaken[one][mine] <= 1

    def _count_anew(self) -> None:
        """From here on, since it cannot be told how far the forwarder has counted."""
        self._since_lower, self._over = PATIENCE, 0
        self._overtaken.clear()


def _is_control(effect: Send) -> bool:
    return effect.header[KIND_AT] != CONTENT
