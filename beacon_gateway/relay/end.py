"""One end of a link: a network, a conduit, and the cores between them.

A *forwarder* takes from the network and gives to the conduit, a *republisher* the other way; an end
has one of them or both. Whatever happens, in whichever thread, is told to the core in turn
(:mod:`.turns`), and what the core asks for is carried out in that turn, without any lock of ours
that somebody could wait for.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import attrs

from beacon_core.clock import Clock
from beacon_core.ports.conduit import Conduit
from beacon_core.ports.topic_side import TopicSide
from beacon_core.relay.effects import (
    Arm,
    CreatePublisher,
    DestroyPublisher,
    Effect,
    Publish,
    Send,
    Subscribe,
    Unsubscribe,
)
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import ForwarderStats, RouteStatus, SeenTopic
from beacon_core.relay.frames import KIND_AT, Kind
from beacon_core.relay.names import Ruling
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.republishing import LaneStatus, RepublisherStats
from beacon_gateway.relay.trace import CoreTrace
from beacon_gateway.relay.turns import Turns
from beacon_gateway.relay.waker import Waker

__all__ = ["End", "Explained", "State"]

_log = logging.getLogger(__name__)

_RESET = int(Kind.RESET)


@attrs.frozen
class State:
    """An end at one moment. Without a core of a kind, its part is ``None``."""

    linked: bool
    linked_since_ns: int
    """When that last changed, by the monotonic clock."""
    forwarder: ForwarderStats | None = None
    routes: Sequence[RouteStatus] = ()
    republisher: RepublisherStats | None = None
    lanes: Sequence[LaneStatus] = ()


@attrs.frozen
class Explained:
    """Why a topic is carried, or is not."""

    ruling: Ruling
    routes: Sequence[RouteStatus]
    """Its own; more than one while an old one lingers."""


class End:
    """Thread rule: ``start`` and ``close`` from one thread, all else from any."""

    def __init__(
        self,
        name: str,
        side: TopicSide,
        conduit: Conduit,
        clock: Clock,
        *,
        forwarder: Forwarder | None = None,
        republisher: Republisher | None = None,
        trace: CoreTrace | None = None,
    ) -> None:
        self.name, self._trace = name, trace
        self._side, self._conduit, self._now_ns = side, conduit, clock.monotonic_ns
        self._forwarder, self._republisher = forwarder, republisher
        self._cores: dict[int, Any] = {
            one: core for one, core in enumerate((forwarder, republisher)) if core is not None
        }
        self._linked, self._linked_since_ns = False, clock.monotonic_ns()
        self._turns = Turns()
        self._waker = Waker(clock, self._rung, f"relay-{name}")
        self._ways = [self._ways_of(one) for one in (0, 1)]

    def start(self) -> None:
        """Begin; raises what the conduit or the topic side raise, and is closed then."""
        try:
            # In turn: so the core is told nothing, and asks for nothing, before both have begun.
            self._turns.ask(self._begin)
        except Exception:
            self.close()
            raise

    def close(self) -> None:
        """Take nothing more from the network, then end. Idempotent."""
        self._side.close()
        self._conduit.close()
        self._waker.close()

    def state(self) -> State:
        """How it is now; ``TimeoutError`` if it is stuck."""
        return self._turns.ask(self._state)

    def explain(self, topic: str) -> Explained | None:
        """Why a topic is forwarded or not; ``None`` if this end forwards nothing."""
        forwarder = self._forwarder
        if forwarder is None:
            return None
        return self._turns.ask(
            lambda: Explained(
                forwarder.explain(topic), [one for one in forwarder.routes() if one.topic == topic]
            )
        )

    # -- what happens, in its turn

    def tell(self, one: int, method: str, *args: Any) -> None:
        """Tell core ``one`` (0 the forwarder, 1 the republisher), if it is there."""
        if one in self._cores:
            self._turns.take(self._told, one, method, args)

    def message(
        self, handle: int, payload: bytes, *, stamp_ns: int = 0, first: int = 0, hop: int = 0
    ) -> None:
        """A message has come from the network."""
        if self._forwarder is not None:
            size = len(payload)
            self._turns.take(self._message, handle, payload, stamp_ns, first, hop, size=size)

    def link(self, *, up: bool) -> None:
        """The conduit's link is up, or down."""
        self._turns.take(self._link, up)

    def frame(self, header: bytes, payload: bytes) -> None:
        """A frame has come: a reset is the forwarder's, all others are the republisher's."""
        one = 0 if len(header) > KIND_AT and header[KIND_AT] == _RESET else 1
        if one not in self._cores:
            # It only counts it.
            one = 1 - one
        if one in self._cores:
            self._turns.take(self._frame, one, header, payload, size=len(payload))

    def _told(self, one: int, method: str, args: tuple[Any, ...]) -> None:
        now_ns = self._now_ns()
        effects = getattr(self._cores[one], method)(*args, now_ns)
        if self._trace is not None:
            self._trace.write(one, method, args, {}, now_ns, effects)
        self._carry_out(one, effects)

    # The two that are called for each message take the short way: no names, nothing unpacked.

    def _message(self, handle: int, payload: bytes, stamp_ns: int, first: int, hop: int) -> None:
        now_ns = self._now_ns()
        effects = self._cores[0].message(
            handle, payload, now_ns, stamp_ns=stamp_ns, first=first, hop=hop
        )
        if self._trace is not None:
            named = {"stamp_ns": stamp_ns, "first": first, "hop": hop}
            self._trace.write(0, "message", (handle, payload), named, now_ns, effects)
        self._carry_out(0, effects)

    def _frame(self, one: int, header: bytes, payload: bytes) -> None:
        now_ns = self._now_ns()
        effects = self._cores[one].frame(header, payload, now_ns)
        if self._trace is not None:
            self._trace.write(one, "frame", (header, payload), {}, now_ns, effects)
        self._carry_out(one, effects)

    def _carry_out(self, one: int, effects: list[Effect]) -> None:
        ways = self._ways[one]
        for effect in effects:
            try:
                ways[type(effect)](effect)
            except Exception:  # noqa: BLE001 - the others must be carried out all the same, above all Arm
                _log.exception("%s: %s was not carried out", self.name, type(effect).__name__)

    def _link(self, up: bool) -> None:  # noqa: FBT001 - it is what has happened
        if up != self._linked:
            self._linked, self._linked_since_ns = up, self._now_ns()
        for one in self._cores:
            self._told(one, "link_up" if up else "link_down", ())

    def _rung(self, one: Hashable) -> None:
        self.tell(0 if one == 0 else 1, "tick")

    def _begin(self) -> None:
        self._waker.start()
        self._conduit.start(_Frames(self))
        self._side.start(_Topics(self))

    def _state(self) -> State:
        forwarder, republisher = self._forwarder, self._republisher
        return State(
            self._linked,
            self._linked_since_ns,
            forwarder.stats() if forwarder else None,
            forwarder.routes() if forwarder else (),
            republisher.stats() if republisher else None,
            republisher.lanes() if republisher else (),
        )

    # -- what is to be done

    def _ways_of(self, one: int) -> Mapping[type[Any], Callable[[Any], object]]:
        side, send = self._side, self._conduit.send

        def arm(effect: Arm) -> None:
            self._waker.set(one, effect.due_ns)

        return {
            Send: lambda effect: send(effect.header, effect.payload),
            Publish: side.publish,
            Arm: arm,
            Subscribe: side.subscribe,
            Unsubscribe: lambda effect: side.unsubscribe(effect.handle),
            CreatePublisher: side.create_publisher,
            DestroyPublisher: lambda effect: side.destroy_publisher(effect.handle),
        }


class _Frames:
    """What the conduit is given to tell."""

    def __init__(self, end: End) -> None:
        self.frame, self.link = end.frame, end.link


class _Topics:
    """What the topic side is given to tell."""

    def __init__(self, end: End) -> None:
        self._tell = end.tell
        self.message = end.message

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        self._tell(0, "topic_seen", topic, seen)

    def topic_gone(self, topic: str) -> None:
        self._tell(0, "topic_gone", topic)

    def matched(self, handle: int, matched: int, expected: int) -> None:
        self._tell(1, "matched", handle, matched, expected)

    def publisher_failed(self, handle: int, reason: str) -> None:
        self._tell(1, "publisher_failed", handle, reason)
