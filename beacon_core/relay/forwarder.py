"""The side that takes messages from its network and sends them: a state machine without I/O.

Theory. A topic that the names allow gets a *route*: a number for its name on the other side, its
type and its quality of service. When any of these changes, the route is closed and another one
opened; a number is never used again. The life of a route::

    (seen, allowed) --> OPEN --gone or changed--> CLOSED --linger--> removed

    OPEN    subscribed; each message gets the next number, is kept and, if there is a link, sent
    CLOSED  nothing is added; what is kept can still be asked for
    REFUSED no route: denied by the names, or what it needs is taken; the reason is told

A forwarder knows nothing of who listens, and awaits no receipts. It says what there is: an
advertisement when a route is opened or closed, a digest each period. Whoever misses something asks,
as fast as it can take it. So one listener, many and none are all the same to it, and the only thing
that grows is what it keeps, which is capped in bytes. What gives way to the cap is the oldest of
the route that holds most, or of the route itself if it holds more than its share.

What it keeps depends on the mode: ORDERED all that the cap allows, STATE the last ``depth``, LATEST
the last one, BEST_EFFORT nothing. A message goes out as it comes, unless its rule or the link's
bucket makes it wait: see outlet.py.

Nothing that comes in makes it send more than: an advertisement per route and a full digest per
``answer_gap_ns``, and each kept message once per ``resend_gap_ns``.
"""

from __future__ import annotations

from beacon_core.relay.effects import Effect, Send, Subscribe, Unsubscribe
from beacon_core.relay.forwarding import ForwarderStats, RouteState, RouteStatus, SeenTopic
from beacon_core.relay.frames import (
    CONTENT,
    HEAD,
    HEADER_BYTES,
    VERSION,
    Advertisement,
    Content,
    Digest,
    Entry,
    Frame,
    Reset,
    content_header,
    decode,
    encode,
    fingerprint,
)
from beacon_core.relay.history import Kept
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.machine import Machine
from beacon_core.relay.names import NameMap, Ruling
from beacon_core.relay.outlet import Outlet
from beacon_core.relay.route import Route, new_route, stats_of, status_of, unfit
from beacon_core.relay.settings import DEFAULT_FORWARDING, MESSAGE_OVERHEAD_BYTES, Forwarding
from beacon_core.relay.values import Mode

__all__ = ["Forwarder"]

_MAX_HELLOS = 64
"""Republishers whose hello waits for its answer."""

_DIGEST, _OUTLET, _HELLO = 0, -1, -2
# Alarms: for the digest, what may go out, and a hello's answer; of closed routes: their numbers.
_RECENT_DIGESTS = 4
"""A change is named in so many digests; whoever misses all is told by the fingerprint."""


class Forwarder(Machine[int]):
    """The theory is above. Each method gives what is to be done now.

    Times are nanoseconds of a monotonic clock; one that goes back counts as no time. Thread rule:
    none of its own; the owner holds a lock, or calls from one thread.
    """

    def __init__(
        self,
        *,
        origin: int,
        epoch: int,
        names: NameMap,
        now_ns: int,
        settings: Forwarding = DEFAULT_FORWARDING,
    ) -> None:
        """``origin``: above 0, this relay's for ever; ``epoch`` rises with each start. 64 bits."""
        super().__init__(now_ns)
        self._origin, self._epoch, self._names, self._settings = origin, epoch, names, settings
        self._began_ns = now_ns
        self._linked = False
        self._control = 0
        self._last_route = 0
        self._seen: dict[str, SeenTopic] = {}
        self._refused: dict[str, str] = {}
        self._open: dict[str, Route] = {}
        self._fed: dict[str, str] = {}
        # By name on the other side: the topic.
        self._routes: dict[int, Route] = {}
        # Open and closed, in the order of their numbers.
        self._held_bytes = 0
        self._most_bytes = min(settings.message_bytes, settings.hold_bytes - MESSAGE_OVERHEAD_BYTES)
        # Of one message.
        self._outlet = Outlet(settings.link_bytes_per_s, now_ns)
        self._past = Ledger()
        self._full_sent_ns: int | None = None
        self._hellos: dict[int, int] = {}
        # By asker: those that have not been answered yet.
        self._malformed = self._foreign = 0

    # -- from the topic side

    def topic_seen(self, topic: str, seen: SeenTopic, now_ns: int) -> list[Effect]:
        """There is a publisher of ``topic``; also to be called when its type or QoS has changed."""
        self._at(now_ns)
        if self._seen.get(topic) != seen:
            self._seen[topic] = seen
            self._close(topic)
            self._admit(topic, seen)
            self._reconsider()
        return self._done()

    def topic_gone(self, topic: str, now_ns: int) -> list[Effect]:
        """Nobody publishes it any more."""
        self._at(now_ns)
        self._seen.pop(topic, None)
        self._refused.pop(topic, None)
        self._close(topic)
        self._reconsider()
        return self._done()

    def message(
        self,
        handle: int,
        payload: bytes,
        now_ns: int,
        *,
        stamp_ns: int = 0,
        first: int = 0,
        hop: int = 0,
    ) -> list[Effect]:
        """A message of the subscription ``handle`` has come from the network.

        One that comes after its subscription has ended may be of another type than the topic has
        now: it is counted as withdrawn. ``first`` and ``hop`` are those of
        :class:`.effects.Publish`, if the topic side can tell that a relay published it; else 0.
        """
        # All messages come this way: so there are few calls, and no detour over the list of
        # effects; no time is set here that would have to be told.
        if now_ns > self._now_ns:  # noqa: PLR1730 - max is a call
            self._now_ns = now_ns
        route = self._routes.get(handle)
        origin, linked = self._origin, self._linked
        if (
            route is None
            or not route.plain
            or first == origin
            or hop >= self._settings.max_hops
            or len(payload) > self._most_bytes
            or not (linked or route.history.most)
        ):
            return self._unusual(route, payload, stamp_ns, first, hop)
        history = route.history
        seq, first = history.next, first or origin
        header = HEAD.pack(
            VERSION, CONTENT, hop, 0, origin, self._epoch, handle, seq, stamp_ns, first
        )
        route.changed_ns = self._now_ns
        self._held_bytes += history.take(header, payload, self._now_ns if linked else None)
        if self._held_bytes > self._settings.hold_bytes:
            self._make_room(route)
        return [Send(header, payload)] if linked else []

    # -- from the conduit

    def frame(self, header: bytes, payload: bytes, now_ns: int) -> list[Effect]:
        """Something has come in. Never raises for what it is."""
        self._at(now_ns)
        frame = decode(header, payload)
        if isinstance(frame, Reset):
            self._asked(frame)
        elif isinstance(frame, Advertisement | Content | Digest):
            self._foreign += 1
        else:
            self._malformed += 1
        return self._done()

    def link_up(self, now_ns: int) -> list[Effect]:
        """Frames may get through from now on."""
        self._at(now_ns)
        self._linked = True
        self._send_digest(full=True)
        self._alarms.set(_DIGEST, self._now_ns + self._settings.digest_ns)
        for route in self._routes.values():
            if route.closed:
                self._alarms.set_if_none(route.number, self._now_ns + self._settings.linger_ns)
        return self._done()

    def link_down(self, now_ns: int) -> list[Effect]:
        """They do not any more: nothing is sent until the next :meth:`link_up`."""
        self._at(now_ns)
        self._linked = False
        for alarm in (_DIGEST, _OUTLET, _HELLO):
            self._alarms.cancel(alarm)
        self._hellos.clear()
        for number, route in self._routes.items():
            # What nobody can have heard of stays until somebody may have.
            self._alarms.cancel(number)
            self._outlet.remove(route.waiting)
            if route.mode is Mode.BEST_EFFORT:
                self._drop_below(route, route.history.next, Fate.UNLINKED)
        return self._done()

    # -- time

    def tick(self, now_ns: int) -> list[Effect]:
        """Do what is due; to be called when :class:`.effects.Arm` says."""
        self._at(now_ns)
        while (due := self._alarms.pop_due(self._now_ns)) is not None:
            if due == _DIGEST:
                self._send_digest(full=False)
                self._alarms.set(_DIGEST, self._now_ns + self._settings.digest_ns)
            elif due == _OUTLET:
                self._let_out()
            elif due == _HELLO:
                self._greet()
            else:
                self._remove(self._routes[due])
        return self._done()

    # -- what people are told

    def explain(self, topic: str) -> Ruling:
        """What the names say of a topic, seen or not."""
        return self._names.rule_on(topic)

    def routes(self) -> list[RouteStatus]:
        """Each topic that has been seen and is not gone, and each route that lingers."""
        refused = [
            RouteStatus(topic, "", RouteState.REFUSED, reason)
            for topic, reason in sorted(self._refused.items())
        ]
        return [*map(status_of, self._routes.values()), *refused]

    def stats(self) -> ForwarderStats:
        """The numbers of this moment."""
        return stats_of(
            self._past,
            self._routes.values(),
            held_bytes=self._held_bytes,
            malformed=self._malformed,
            foreign=self._foreign,
        )

    # -- routes

    def _admit(self, topic: str, seen: SeenTopic) -> None:
        ruling = self._names.rule_on(topic)
        reason = self._reason_against(ruling, seen)
        if reason:
            self._refused[topic] = reason
            return
        self._refused.pop(topic, None)
        self._last_route += 1
        limited = self._outlet.limited
        route = new_route(self._last_route, topic, ruling, seen, self._now_ns, limited=limited)
        self._open[topic] = self._routes[route.number] = route
        self._fed[ruling.name] = topic
        self._effects.append(Subscribe(route.number, topic, seen.type, seen.qos))
        self._advertise(route)

    def _reason_against(self, ruling: Ruling, seen: SeenTopic) -> str:
        if not ruling.allowed:
            return ruling.reason
        if ruling.name in self._fed:
            return f"{ruling.name} is fed by {self._fed[ruling.name]} already"
        if len(self._routes) >= self._settings.max_routes:
            return f"there are {len(self._routes)} routes already"
        return unfit(ruling.name, seen)

    def _reconsider(self) -> None:
        """Whoever was refused what is free now, the first in the alphabet first."""
        for topic in sorted(self._refused):
            self._admit(topic, self._seen[topic])

    def _close(self, topic: str) -> None:
        route = self._open.pop(topic, None)
        if route is not None:
            del self._fed[route.ruling.name]
            route.closed, route.plain = True, False
            route.revision += 1
            route.changed_ns = self._now_ns
            self._effects.append(Unsubscribe(route.number))
            self._advertise(route)
            if self._linked:
                self._alarms.set(route.number, self._now_ns + self._settings.linger_ns)

    def _remove(self, route: Route) -> None:
        self._outlet.remove(route.waiting)
        self._drop_below(route, route.history.next, Fate.WITHDRAWN)
        del self._routes[route.number]
        self._past.add(route.ledger)
        self._reconsider()

    # -- messages

    def _unusual(
        self, route: Route | None, payload: bytes, stamp_ns: int, first: int, hop: int
    ) -> list[Effect]:
        """A message that is not taken, or that may have to wait."""
        if route is None or route.closed:
            self._past.pass_on(Fate.WITHDRAWN)
            return []
        fate = self._barred(route, payload, first, hop)
        if fate is not None:
            route.ledger.pass_on(fate)
            return []
        numbers = (self._origin, self._epoch, route.number, route.history.next)
        header = content_header(*numbers, stamp_ns, first or self._origin, hop)
        route.changed_ns = self._now_ns
        self._held_bytes += route.history.take(header, payload, None)
        route.waiting.took(self._now_ns, waits=self._linked)
        self._expire(route)
        if self._linked:
            self._outlet.add(route.waiting, self._now_ns, paced=route.paced)
            self._let_out()
        # Only now: what may go at once needs no room.
        self._make_room(route)
        return self._done()

    def _barred(self, route: Route, payload: bytes, first: int, hop: int) -> Fate | None:
        if first == self._origin:
            return Fate.ECHO
        if hop >= self._settings.max_hops:
            return Fate.HOPS
        if len(payload) > self._most_bytes:
            return Fate.OVERSIZE
        if route.mode is Mode.BEST_EFFORT and not self._linked:
            return Fate.UNLINKED
        if route.paced or route.waiting.passes(HEADER_BYTES + len(payload), self._now_ns):
            return None
        return Fate.LIMITED

    def _let_out(self) -> None:
        """Send what waits and may go now; and see to the rest when it may."""
        while (found := self._outlet.next(self._now_ns)) is not None:
            waiting, kept = found
            route = self._routes[waiting.number]
            if route.paced and kept.sent_ns is None:
                waiting.spend(len(kept.header) + len(kept.payload), self._now_ns)
            route.changed_ns = self._now_ns
            self._send_content(kept)
            if route.mode is Mode.BEST_EFFORT:
                # It was kept only for as long as it had to wait.
                self._drop_below(route, kept.seq + 1, Fate.EVICTED)
        due_ns = self._outlet.due_ns()
        if due_ns is None:
            self._alarms.cancel(_OUTLET)
        else:
            self._alarms.set(_OUTLET, due_ns)

    def _expire(self, route: Route) -> None:
        """Let go what is too old."""
        self._drop_below(route, route.waiting.fresh_from(self._now_ns), Fate.EXPIRED)

    def _drop_below(self, route: Route, seq: int, unsent: Fate) -> None:
        while route.history.low < seq:
            self._drop_oldest(route, unsent)

    def _make_room(self, route: Route) -> None:
        while self._held_bytes > self._settings.hold_bytes:
            self._drop_oldest(self._largest(route), Fate.EVICTED)

    def _largest(self, route: Route) -> Route:
        if route.history.held_bytes * len(self._routes) > self._settings.hold_bytes:
            return route
        return max(self._routes.values(), key=lambda one: one.history.held_bytes)

    def _drop_oldest(self, route: Route, unsent: Fate) -> None:
        self._held_bytes -= route.history.drop_oldest(unsent)
        route.changed_ns = self._now_ns

    # -- questions

    def _asked(self, reset: Reset) -> None:
        ours = (reset.origin, reset.epoch) == (self._origin, self._epoch)
        if not ours and reset.origin != 0:
            self._foreign += 1
            return
        if not self._linked:
            return
        if reset.hello:
            self._answer_hello(reset)
        if ours:
            self._answer_wanted(reset)
            self._answer_ranges(reset)

    def _answer_hello(self, reset: Reset) -> None:
        if reset.asker in self._hellos or len(self._hellos) < _MAX_HELLOS:
            self._hellos[reset.asker] = reset.hello
            self._greet()

    def _greet(self) -> None:
        """Answer the hello that has waited longest, if it may be, and the next one later.

        Several may say hello at once, since the same digest made them, and each of them again and
        again: whoever is not answered now must not have to come at a better time.
        """
        gap_ns, last_ns = self._settings.answer_gap_ns, self._full_sent_ns
        if last_ns is None or self._now_ns - last_ns >= gap_ns:
            asker = next(iter(self._hellos))
            last_ns = self._full_sent_ns = self._now_ns
            self._send_digest(full=True, asker=asker, hello=self._hellos.pop(asker))
        if self._hellos:
            self._alarms.set(_HELLO, last_ns + gap_ns)
        else:
            self._alarms.cancel(_HELLO)

    def _answer_wanted(self, reset: Reset) -> None:
        for number in reset.wanted:
            route = self._routes.get(number)
            if route is not None and self._may_tell(route):
                self._advertise(route, definition=reset.definitions)

    def _answer_ranges(self, reset: Reset) -> None:
        for one in reset.ranges:
            route = self._routes.get(one.route)
            if route is None:
                continue
            self._expire(route)
            if one.start < route.history.low and self._may_tell(route):
                # An advertisement also says what cannot be had any more.
                self._advertise(route)
            for kept in route.history.run(one.start, one.count):
                gap_ns = self._settings.resend_gap_ns
                if kept.sent_ns is not None and self._now_ns - kept.sent_ns < gap_ns:
                    continue
                if not route.shaped:
                    self._send_content(kept)
                elif route.waiting.ask(kept.seq):
                    self._outlet.add(route.waiting, self._now_ns, paced=False)
        self._let_out()

    def _may_tell(self, route: Route) -> bool:
        told_ns = route.told_ns
        return told_ns is None or self._now_ns - told_ns >= self._settings.answer_gap_ns

    # -- frames

    def _advertise(self, route: Route, *, definition: bool = False) -> None:
        if not self._linked:
            return
        route.told_ns = self._now_ns
        head = (self._origin, self._epoch, route.number, self._next_control(), route.revision)
        self._send(
            Advertisement(
                *head,
                route.history.low,
                route.told_next,
                route.ruling.name,
                route.seen.type,
                route.seen.qos,
                route.mode,
                closed=route.closed,
                definition=route.seen.definition if definition else None,
            )
        )

    def _send_digest(self, *, full: bool, asker: int = 0, hello: int = 0) -> None:
        since_ns = self._now_ns - _RECENT_DIGESTS * self._settings.digest_ns
        named, others = [], []
        for route in self._routes.values():
            self._expire(route)
            if full or route.changed_ns >= since_ns:
                low, told = route.history.low, route.told_next
                named.append(Entry(route.number, route.revision, low, told))
            else:
                others.append((route.number, route.revision, route.told_next))
        self._send(
            Digest(
                self._origin,
                self._epoch,
                self._next_control(),
                self._now_ns - self._began_ns,
                full,
                fingerprint(others),
                tuple(named),
                asker,
                hello,
            )
        )

    def _send_content(self, kept: Kept) -> None:
        kept.sent_ns = self._now_ns
        self._effects.append(Send(kept.header, kept.payload))

    def _send(self, frame: Frame) -> None:
        header, payload = encode(frame)
        self._outlet.pay(len(header) + len(payload), self._now_ns)
        self._effects.append(Send(header, payload))

    def _next_control(self) -> int:
        self._control += 1
        return self._control
