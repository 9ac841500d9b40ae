"""The receiving half: hints of nodes that run rmw_zenoh, and their graph."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from functools import partial

import zenoh

from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_core.wire.medkit import GOODBYE, NO_STAMP, TYPE_HASH, TYPE_NAME, said_goodbye
from beacon_zenoh.gate import Gate
from beacon_zenoh.keys import Token
from beacon_zenoh.questions import EVERYBODY, Questions
from beacon_zenoh.rmw.attachment import decode
from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.keys import data_key, data_key_of, every_hash, kept_by
from beacon_zenoh.rmw.options import RmwOptions
from beacon_zenoh.rmw.publishers import Heard, Publishers
from beacon_zenoh.rmw.qos import Qos
from beacon_zenoh.rmw.session import hint_member, node_member, rmw_session_config
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key
from beacon_zenoh.rmw.watch import Watch
from beacon_zenoh.roster import Roster
from beacon_zenoh.session import CLOSE_WITHIN_S, SessionKeeper

__all__ = ["RmwTopicSource"]

_log = logging.getLogger(__name__)

_ANSWER_WITHIN_S = 2.0
"""How long a question stays open: a hung publisher costs no more than its slot until then."""

_STEP_AT_LEAST_S = 0.025
"""What becomes due meanwhile is done at one go: a thousand tokens make one question."""

_SHOWN = 3
"""Publishers with something odd that health names; of the others it tells the number."""


class RmwTopicSource:
    """Implements :class:`beacon_core.ports.source.HintSource` and
    :class:`beacon_core.ports.graph.Graph`; the thread rules are the ports'.

    The sink's ``source`` is the GID of the publisher, in hexadecimal, and so is the incarnation: a
    publisher lives as long as the run of its process. It stands in the attachment of each message,
    where the sender puts it: without access control, anybody may speak in anybody's name.
    """

    def __init__(self, options: RmwOptions) -> None:
        """Opens nothing. ``ConfigError`` for what Zenoh refuses."""
        self._options = options
        self._name = f"_beacon_gateway_{secrets.token_hex(4)}"
        self._keeper = SessionKeeper(
            rmw_session_config(options),
            declare=self._declare,
            step=self._step,
            farewell=lambda _: None,
        )
        self._watch = Watch(options.ros_domain_ids, self, self._keeper)
        admits = (lambda member: options.admits(member.namespace)) if options.restricted else None
        self._publishers = Publishers(admits)
        self._known = self._publishers.heard.get
        self._roster = Roster()
        self._questions = Questions(time.monotonic_ns())
        self._awaited = self._roster.awaited
        self._gate = Gate()
        self._tokens: list[zenoh.LivelinessToken] = []  # they live as long as somebody holds them
        self._odd: dict[str, str] = {}  # what is to be complained of, by token
        self._counting = threading.Lock()
        self._counters = dict.fromkeys(
            (
                "asked",
                "bad-attachments",
                "bad-keys",
                "goodbyes",
                "lost",
                "messages",
                "not-admitted",
            ),
            0,
        )

    @property
    def graph(self) -> Graph:
        """All nodes of the domains. Kept up to date while the source is open."""
        return self._watch.graph

    def nodes(self) -> frozenset[str]:
        """See the port. Of several domains all together."""
        return frozenset() if self._keeper.closed else self.graph.names()

    def start(self, sink: HintSink) -> None:
        self._gate.lead_to(sink)
        self._keeper.start()

    def close(self) -> None:
        if self._keeper.forked:
            return
        spent_s = self._gate.shut(CLOSE_WITHIN_S / 2)
        self._keeper.close(0.0 if spent_s < 0 else CLOSE_WITHIN_S - spent_s)

    def health(self) -> Health:
        health = self._keeper.health(
            {
                **self._counters,
                "bad-tokens": self.graph.malformed,
                "nodes": self.graph.size(),
                "publishers": len(self._publishers),
                "questions-postponed": self._questions.postponed,
                "renewals": self._keeper.renewed,
                "refused": self._publishers.refused + self.graph.refused,
                "sink-errors": self._gate.errors,
                "tokens": len(self.graph),
            }
        )
        complaints = list(self._odd.values())
        if health.condition is not Condition.UP or not complaints:
            return health
        others = len(complaints) - _SHOWN
        more = f"; and {others} more" if others > 0 else ""
        detail = "; ".join(complaints[:_SHOWN]) + more
        return Health(Condition.DEGRADED, detail, health.counters)

    # -- in the keeper's thread ------------------------------------------------------------------

    def _declare(self, session: zenoh.Session) -> None:
        self._tokens.clear()
        for number, domain in enumerate(self._options.ros_domain_ids):
            hints = every_hash(domain, self._options.topic, TYPE_NAME)
            session.declare_subscriber(hints, self._on_hint)
            self._show_ourselves(session, domain, 2 * number)
        self._watch.begin(session, self._roster.all_vanished)

    def _show_ourselves(self, session: zenoh.Session, domain: int, number: int) -> None:
        """So that ``ros2 topic info`` finds us, and those who publish only for somebody."""
        node = node_member(domain, str(session.zid()), number, self._name)
        topic = self._options.topic
        for member in (node, hint_member(node, Kind.SUBSCRIBER, number + 1, topic, _OUR_QOS)):
            self._tokens.append(session.liveliness().declare_token(token_key(member)))

    def _step(self, session: zenoh.Session | None) -> float | None:
        now_ns = time.monotonic_ns()
        watch_again_ns = self._watch.step(now_ns)
        self._publishers.settle(now_ns)
        due = self._roster.due(now_ns)
        for token in due.lost:
            self._lose(bytes.fromhex(token.entity_id))
        self._questions.want(one for one in due.ask if self._keeps(one))
        if session is None:
            self._questions.drop()
        else:
            self._ask_who_waits(session, now_ns)
        times = (
            self._roster.next_due_ns(),
            self._publishers.next_due_ns(),
            self._questions.next_due_ns(),
            watch_again_ns,
        )
        next_ns = min((one for one in times if one is not None), default=None)
        return None if next_ns is None else max(_STEP_AT_LEAST_S, (next_ns - now_ns) / 1e9)

    def _keeps(self, name: str) -> bool:
        """Does the publisher with this token keep what it said?"""
        member = self._publishers.member(bytes.fromhex(name))
        return member is not None and member.qos.keeps

    def _ask_who_waits(self, session: zenoh.Session, now_ns: int) -> None:
        """Ask to be told what publishers keep."""
        for name in self._questions.take(now_ns):
            if name == EVERYBODY:
                topic = self._options.topic
                for domain in self._options.ros_domain_ids:
                    self._ask(session, kept_by(every_hash(domain, topic, TYPE_NAME)))
            elif (member := self._publishers.member(bytes.fromhex(name))) is not None:
                self._ask(session, kept_by(data_key(member.data_key), member.zid))

    def _ask(self, session: zenoh.Session, question: str) -> None:
        self._count("asked")
        session.get(
            question,
            self._on_reply,
            # Anyone could declare a queryable "complete" and be the only one to be asked.
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=_ANSWER_WITHIN_S,
        )

    def _lose(self, token: bytes) -> None:
        why = "its node left the ROS graph without a goodbye"
        if self._keeper.config.mode == "client" and not self._keeper.connected:
            why = "the gateway itself lost its connection to the router"
        for publisher in self._publishers.unlisted(token):
            # Through the gate, as words of the same publisher may be on their way to the sink.
            spoken_for = self._gate.let(partial(_missing, publisher)) or ()
            for entity_id in spoken_for:
                self._count("lost")
                self._gate.let(partial(_lost, entity_id, publisher.name, why))

    # -- in callback threads of Zenoh's ----------------------------------------------------------

    def came(self, key: str, member: Member, now_ns: int) -> None:
        """As the watch wants it."""
        if member.kind is Kind.NODE:
            # Back before its publishers ever went.
            for one, having in self.graph.members_of(member.node_key).items():
                self.came(one, having, now_ns)
        if member.kind is not Kind.PUBLISHER or member.name != self._options.topic:
            return
        if (complaint := _complaint(member)) and key not in self._odd:
            self._odd[key] = complaint
            _log.warning("%s: %s", member.name, complaint)
        if member.type_name == TYPE_NAME:
            gid = gid_of(key)
            self._publishers.listed(gid, member, now_ns)
            self._roster.appeared(Token(gid.hex()), now_ns)

    def came_again(self, key: str, now_ns: int) -> None:
        """The same. Reported by another session: it has not gone with the last."""
        gid = gid_of(key)
        if gid in self._publishers:
            self._roster.appeared(Token(gid.hex()), now_ns)

    def went(self, key: str, member: Member, now_ns: int) -> None:
        """The same."""
        if member.kind is Kind.NODE:
            for one, having in self.graph.members_of(member.node_key).items():
                self.went(one, having, now_ns)
        elif member.kind is Kind.PUBLISHER:
            self._odd.pop(key, None)
            self._roster.vanished(Token(gid_of(key).hex()), now_ns)

    def _on_reply(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self._on_hint(reply.ok, answering=True)

    def _on_hint(self, sample: zenoh.Sample, *, answering: bool = False) -> None:
        """The road of every message: in the order sent."""
        attachment = sample.attachment
        envelope = None if attachment is None else decode(attachment.to_bytes())
        if envelope is None:
            # As rmw_zenoh does: without it nobody knows who speaks.
            self._count("bad-attachments")
            return
        gid, sequence, stamp_ns = envelope
        publisher = self._known(gid) or self._meet(gid, sample)
        if publisher is None:
            return
        if not publisher.allowed:
            self._count("not-admitted")
            return
        payload = sample.payload.to_bytes()
        if payload[-8:] != NO_STAMP:
            if payload.endswith(GOODBYE) and (entity_id := said_goodbye(payload)):
                self._goodbye(publisher, entity_id, sequence)
                return
            # One clock per sender: its own stamps may be of simulated time, rmw's never are.
            stamp_ns = 0
        # Who is heard from the first word on has not said anything before.
        if (answering or sequence == 1) and publisher.name in self._awaited:
            self._roster.heard(Token(publisher.name))
        self._gate.let(
            partial(self._offer, publisher, payload, sequence, stamp_ns, answering=answering)
        )

    def _offer(
        self,
        publisher: Heard,
        payload: bytes,
        sequence: int,
        stamp_ns: int,
        sink: HintSink,
        *,
        answering: bool,
    ) -> None:
        name = publisher.name
        if answering and (entity_id := publisher.numbers.get(sequence)):
            if entity_id not in publisher.missed:
                return
            # It is back after a loss, and this is still what it has to say: said after the loss,
            # since we asked after it.
            outcome = sink.offer(payload, name, incarnation=name)
        else:
            outcome = sink.offer(
                payload, name, stamp_ns=stamp_ns, incarnation=name, sequence=sequence
            )
        self._counters["messages"] += 1  # one at a time comes through the gate
        if outcome.accepted:
            self._publishers.spoke(publisher, outcome.entity_id, sequence)

    def _meet(self, gid: bytes, sample: zenoh.Sample) -> Heard | None:
        named = data_key_of(str(sample.key_expr))
        if named is None:
            self._count("bad-keys")
            return None
        stamp = sample.timestamp
        zid = "" if stamp is None else str(stamp.get_id())
        publisher = self._publishers.meet(gid, data_key(named), zid, time.monotonic_ns())
        self._keeper.wake()
        return publisher

    def _goodbye(self, publisher: Heard, entity_id: str, sequence: int) -> None:
        self._count("goodbyes")
        name = publisher.name

        def said(sink: HintSink) -> None:
            self._publishers.left(publisher, entity_id)
            sink.goodbye(entity_id, name, incarnation=name, sequence=sequence)

        self._gate.let(said)

    def _count(self, what: str) -> None:
        with self._counting:
            self._counters[what] += 1


_OUR_QOS = Qos(durability=1, depth=1)


def _missing(publisher: Heard, _: HintSink) -> list[str]:
    """Whom a publisher that has gone spoke for, and was not missed yet; from now on they are."""
    newly = list(publisher.entities.keys() - publisher.missed)
    publisher.missed.update(newly)
    return newly


def _lost(entity_id: str, name: str, why: str, sink: HintSink) -> None:
    sink.lost(entity_id, name, incarnation=name, reason=why)


def _complaint(publisher: Member) -> str:
    """What is odd about a publisher on our topic; ``""``: nothing."""
    name = publisher.node_name
    if publisher.type_name != TYPE_NAME:
        return f"{name} is not heard: it publishes {publisher.type_name}, not {TYPE_NAME}"
    if publisher.type_hash != TYPE_HASH:
        return (
            f"{name} has another definition of the message and may be misread: "
            f"{publisher.type_hash}, not {TYPE_HASH}"
        )
    return ""
