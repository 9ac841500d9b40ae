"""What a forwarder knows of one topic, of one type and quality of service."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Collection

import attrs

from beacon_core.relay.forwarding import ForwarderStats, RouteState, RouteStatus, SeenTopic
from beacon_core.relay.frames import MAX_DEFINITION_BYTES
from beacon_core.relay.history import History
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.names import Ruling
from beacon_core.relay.shaping import UNSHAPED
from beacon_core.relay.values import Mode, Qos
from beacon_core.relay.waiting import Waiting

__all__ = ["Route", "mode_of", "new_route", "stats_of", "status_of", "unfit"]

_MAX_NAME_BYTES = 255


@attrs.define
class Route:
    """Thread rule: none of its own."""

    number: int
    topic: str
    ruling: Ruling
    seen: SeenTopic
    mode: Mode
    ledger: Ledger
    history: History
    waiting: Waiting
    """What of it waits to go out; nothing ever does unless it is ``shaped``."""
    shaped: bool
    plain: bool
    """It takes messages, and they go out at once: neither closed nor shaped."""
    changed_ns: int
    closed: bool = False
    revision: int = 0
    told_ns: int | None = None
    """When it was advertised last."""

    @property
    def told_next(self) -> int:
        """The next number, as far as the other side is to know."""
        return self.history.next if self.closed else self.waiting.told_next()

    @property
    def paced(self) -> bool:
        """Its newest message waits for its own turn, instead of being dropped."""
        return self.mode is Mode.LATEST


def new_route(
    number: int, topic: str, ruling: Ruling, seen: SeenTopic, now_ns: int, *, limited: bool
) -> Route:
    """An open one; ``limited``: the link has a bucket, so all routes are shaped."""
    mode, ledger = mode_of(ruling, seen.qos), Ledger()
    shaped = limited or ruling.shaping != UNSHAPED
    history = _history(mode, seen.qos, ledger, shaped=shaped)
    waiting = Waiting(number, history, ruling.shaping, now_ns)
    return Route(
        number, topic, ruling, seen, mode, ledger, history, waiting, shaped, not shaped, now_ns
    )


def mode_of(ruling: Ruling, qos: Qos) -> Mode:
    """What is promised for a topic."""
    if ruling.mode is not None:
        return ruling.mode
    if qos.durable:
        return Mode.STATE
    return Mode.ORDERED if qos.reliable else Mode.BEST_EFFORT


def unfit(name: str, seen: SeenTopic) -> str:
    """Why no frame can tell of such a topic; empty if one can."""
    if not all(map(_fits, (name, seen.type.name, seen.type.digest))):
        return "its name, its type or its type's hash is missing, too long or not printable"
    definition = seen.definition or b""
    return "" if len(definition) <= MAX_DEFINITION_BYTES else "its definition is too long"


def status_of(route: Route) -> RouteStatus:
    """How one topic is."""
    return RouteStatus(
        route.topic,
        route.ruling.name,
        RouteState.CLOSED if route.closed else RouteState.OPEN,
        route.ruling.reason,
        route.number,
        route.mode,
        route.history.next,
        len(route.history),
        route.history.held_bytes,
        route.ledger.fates(),
    )


def stats_of(
    past: Ledger, routes: Collection[Route], *, held_bytes: int, malformed: int, foreign: int
) -> ForwarderStats:
    """The books of all routes together, and of ``past``, those that are removed."""
    ledgers = [past, *(route.ledger for route in routes)]
    fates: Counter[Fate] = Counter()
    for ledger in ledgers:
        fates.update(ledger.fates())
    return ForwarderStats(
        entered=sum(ledger.entered for ledger in ledgers),
        held=sum(len(route.history) for route in routes),
        held_bytes=held_bytes,
        routes=len(routes),
        fates=dict(fates),
        malformed=malformed,
        foreign=foreign,
    )


def _history(mode: Mode, qos: Qos, ledger: Ledger, *, shaped: bool) -> History:
    match mode:
        case Mode.ORDERED:
            return History(ledger, sys.maxsize, Fate.EVICTED)
        case Mode.STATE:
            return History(ledger, max(1, qos.depth), Fate.EVICTED)
        case Mode.LATEST:
            return History(ledger, 1, Fate.CONFLATED)
    # Nobody asks for them; but where they are to wait, they must be somewhere.
    return History(ledger, max(1, qos.depth) if shaped else 0, Fate.EVICTED)


def _fits(text: str) -> bool:
    return text.isprintable() and 0 < len(text.encode()) <= _MAX_NAME_BYTES
