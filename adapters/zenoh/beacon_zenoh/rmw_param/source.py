"""The receiving half: nodes are asked for their parameters, and what follows goes to a sink."""

from __future__ import annotations

import logging
import time
from collections import deque
from functools import partial

import zenoh

from beacon_core.errors import UsageError
from beacon_core.parameters.asker import Asker
from beacon_core.parameters.complaints import complaints
from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.keys import every_hash
from beacon_zenoh.rmw.session import rmw_session_config
from beacon_zenoh.rmw.tokens import Kind, Member
from beacon_zenoh.rmw.watch import Watch
from beacon_zenoh.rmw_param.clients import MAX_ANSWER_BYTES, ZenohClients
from beacon_zenoh.rmw_param.messages import Event, decode_event
from beacon_zenoh.rmw_param.options import RmwParamOptions
from beacon_zenoh.rmw_param.roll import Roll
from beacon_zenoh.rmw_param.services import EVENTS_TOPIC, EVENTS_TYPE
from beacon_zenoh.session import CLOSE_WITHIN_S, SessionKeeper

__all__ = ["RmwParamSource"]

_log = logging.getLogger(__name__)

_MS = 1_000_000

_LOOK_AT_MOST_EVERY_NS = 25 * _MS
"""However many tokens come and go: a look takes 10 us for each node."""

_DOUBT_EVERY_NS = 1000 * _MS
"""How often it is looked for nodes that never answer."""

_MAX_EVENTS = 10_000
"""Events not yet read. Each would only make a node be asked that is asked anyway."""

_PREFIX = PREFIX.encode()


class RmwParamSource:
    """Implements :class:`beacon_core.ports.source.HintSource`,
    :class:`beacon_core.ports.targeted.Targeted` and :class:`beacon_core.ports.graph.Graph`; the
    thread rules are the ports'.

    The sink's ``source`` is the node's full name, with its domain before it where several domains
    are heard. The incarnation is the node's session and number in it. One thread of its own asks,
    and calls the sink; so a sink that is slow slows down the asking.
    """

    def __init__(self, options: RmwParamOptions) -> None:
        """Opens nothing. ``ConfigError`` for what Zenoh refuses."""
        self._options = options
        self._keeper = SessionKeeper(
            rmw_session_config(options),
            declare=self._declare,
            step=self._step,
            farewell=lambda _: None,
        )
        self._watch = Watch(options.ros_domain_ids, self, self._keeper)
        self._roll = Roll(options)
        self._clients = ZenohClients(self._roll.doors, options.timeout_s, self._keeper.wake)
        self._targets: frozenset[str] | None = None
        self._asker: Asker | None = None
        self._events: deque[tuple[int, bytes]] = deque()
        self._counters = dict.fromkeys(("bad-events", "events", "events-dropped"), 0)
        self._stale = True  # the graph, or who is wanted, is another than when last looked at
        self._look_not_before_ns = 0
        self._doubt_at_ns = 0
        self._odd: set[str] = set()  # nodes that only seem to be there
        self._looked_into: set[str] = set()  # of these, who was so when the session began
        self._absent: tuple[str, ...] = ()
        if options.budget_s <= options.timeout_s:
            _log.warning(
                "budget_s: %g is not above timeout_s (%g): one node that hangs ends the round",
                options.budget_s,
                options.timeout_s,
            )

    @property
    def graph(self) -> Graph:
        """All nodes of the domains. Kept up to date while the source is open."""
        return self._watch.graph

    def nodes(self) -> frozenset[str]:
        """See the port. Of several domains all together."""
        return frozenset() if self._keeper.closed else self.graph.names()

    def start(self, sink: HintSink) -> None:
        if self._asker is not None:
            raise UsageError("start: it was started or closed already; make a new one")
        self._asker = Asker(
            self._options, self._clients, sink, self._keeper.wake, time.monotonic_ns()
        )
        self._keeper.start()

    def close(self) -> None:
        if self._keeper.forked:
            return
        if self._asker is not None:
            self._asker.stop()
        self._keeper.close(CLOSE_WITHIN_S)

    def set_targets(self, nodes: frozenset[str] | None) -> None:
        """See the port; ``targets`` in the options come first."""
        self._targets, self._stale = nodes, True
        if not self._keeper.forked:
            self._keeper.wake()

    def health(self) -> Health:
        asker = self._asker
        health = self._keeper.health(
            {
                **({} if asker is None else asker.counters()),
                **self._counters,
                "bad-answers": self._clients.bad_answers,
                "bad-tokens": self.graph.malformed,
                "foreign-answers": self._clients.foreign_answers,
                "nodes": self.graph.size(),
                "renewals": self._keeper.renewed,
                "tokens": len(self.graph),
                "tokens-refused": self.graph.refused,
            }
        )
        if asker is None or health.condition is not Condition.UP:
            return health
        detail = complaints(asker.silent(), self._absent, asker.namesakes)
        return Health(Condition.DEGRADED, detail, health.counters) if detail else health

    # -- in the keeper's thread ------------------------------------------------------------------

    def _declare(self, session: zenoh.Session) -> None:
        if self._options.parameter_events:
            for domain in self._options.ros_domain_ids:
                # Direct, so that it has no thread of its own: it only puts the event in line.
                on_event = zenoh.handlers.Callback(partial(self._on_event, domain), indirect=False)
                session.declare_subscriber(every_hash(domain, EVENTS_TOPIC, EVENTS_TYPE), on_event)
        self._looked_into = self._odd
        self._watch.begin(session, lambda _: None)

    def _step(self, session: zenoh.Session | None) -> float | None:
        asker, now_ns = self._asker, time.monotonic_ns()
        if asker is None:
            return None
        self._clients.session = session
        watch_again_ns = self._watch.step(now_ns, busy=self._clients.waiting > 0)
        look_at_ns = self._look_at_ns()
        if look_at_ns is not None and look_at_ns <= now_ns:
            self._look(asker, now_ns)
        self._read_events(asker, now_ns)
        self._clients.deliver()
        self._doubt(asker, now_ns)
        times = (asker.step(now_ns), watch_again_ns, self._look_at_ns())
        next_ns = min(one for one in times if one is not None)
        return max(0.0, (next_ns - time.monotonic_ns()) / 1e9)

    def _look_at_ns(self) -> int | None:
        """When to look at the graph; ``None``: it is as it was."""
        if self._stale:
            return self._look_not_before_ns
        return self._roll.next_due_ns()

    def _look(self, asker: Asker, now_ns: int) -> None:
        self._stale = False
        self._look_not_before_ns = now_ns + _LOOK_AT_MOST_EVERY_NS
        runs = self._roll.call(self.graph, now_ns)
        given = self._options.targets or self._targets
        wanted = self._roll.visible() if given is None else self._roll.named(given)
        self._absent = tuple(self._roll.missing(self._options.targets))
        why = "its node left the ROS graph without a goodbye"
        if self._keeper.config.mode == "client" and not self._keeper.connected:
            why = "the gateway itself lost its connection to the router"
        asker.see(runs, wanted, now_ns, why_gone=why)

    def _doubt(self, asker: Asker, now_ns: int) -> None:
        """Have it seen whether the tokens of those who never answer are ghosts: once of each, for
        another session tells the truth."""
        if self._doubt_at_ns <= now_ns:
            self._doubt_at_ns = now_ns + _DOUBT_EVERY_NS
            self._odd = {*asker.silent(), *asker.namesakes}
            if self._odd - self._looked_into:
                self._watch.suspect()

    def _read_events(self, asker: Asker, now_ns: int) -> None:
        while self._events:
            domain, payload = self._events.popleft()
            event = decode_event(payload)
            if event is None:
                self._counters["bad-events"] += 1
                continue
            self._counters["events"] += 1
            asker.changed(self._roll.name(domain, event.node), now_ns, leaving=_leaving(event))

    # -- in callback threads of Zenoh's ----------------------------------------------------------

    def came(self, key: str, member: Member, now_ns: int) -> None:  # noqa: ARG002 - the watch's
        """As the watch wants it."""
        if member.kind is Kind.NODE:
            self._roll.came(member)
        self._stale = True

    def came_again(self, key: str, now_ns: int) -> None:
        """The same: nothing is new."""

    def went(self, key: str, member: Member, now_ns: int) -> None:  # noqa: ARG002 - the watch's
        """The same."""
        if member.kind is Kind.NODE:
            self._roll.went(member, now_ns)
        self._stale = True

    def _on_event(self, domain: int, sample: zenoh.Sample) -> None:
        if len(self._events) >= _MAX_EVENTS or len(sample.payload) > MAX_ANSWER_BYTES:
            self._counters["events-dropped"] += 1
            return
        payload = sample.payload.to_bytes()
        if _PREFIX in payload:
            self._events.append((domain, payload))
            self._keeper.wake()


def _leaving(event: Event) -> bool | None:
    """The hint was taken back; it was not (the entity id has a value); ``None``: not told."""
    for parameters in (event.changed, event.new):
        if ENTITY_ID in parameters:
            return not isinstance(parameters[ENTITY_ID], str) or not parameters[ENTITY_ID]
    return True if ENTITY_ID in event.deleted else None
