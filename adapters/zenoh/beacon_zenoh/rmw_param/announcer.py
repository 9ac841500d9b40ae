"""The sending half: a node for each entity, with its hint as parameters that can be asked for."""

from __future__ import annotations

import itertools
import logging
import secrets
import threading
import time
from collections import deque
from collections.abc import Iterable

import attrs
import zenoh

from beacon_core.checks import period_ns
from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import write
from beacon_core.ports.health import Condition, Health
from beacon_core.validator import require_id
from beacon_zenoh.config import reason
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.keys import DataKey, data_key, data_key_of
from beacon_zenoh.rmw.session import rmw_session_config
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key
from beacon_zenoh.rmw_param.messages import Event, encode_event
from beacon_zenoh.rmw_param.options import RmwParamOptions
from beacon_zenoh.rmw_param.services import (
    EVENTS_HASH,
    EVENTS_TOPIC,
    EVENTS_TYPE,
    SERVICES,
    events_member,
    service_member,
)
from beacon_zenoh.rmw_param.voices import Voice, answer
from beacon_zenoh.session import SessionKeeper

__all__ = ["RmwParamAnnouncer"]

_log = logging.getLogger(__name__)

_MAX_QUESTIONS = 10_000
"""Not yet answered. Each takes Zenoh some memory at both ends; a flood of them is dropped."""

_MAX_REQUEST_BYTES = 1 << 20

_LINGER_S = 0.4
"""How long ``close`` waits for whoever asks to have asked once more: who does not listen to events
gets to know that way."""

_MISSED_AFTER_INTERVALS = 3
_MISSED_AFTER_S = 15.0
"""Whoever asked, and has not for so long, is gone. Three intervals by default, or three of ours if
those are longer: the asker's are not known here."""

_IDS_PER_NODE = 16
"""Numbers for the members of a node: itself, six services and a publisher."""

_KINDS = {service.type_name: service for service in SERVICES}


@attrs.define(eq=False)
class _Stand:
    """A node of a voice in one domain, on the present session."""

    domain: int
    gid: bytes
    """Of its publisher of events."""
    tokens: list[zenoh.LivelinessToken]
    sequence: int = 0


class RmwParamAnnouncer:
    """Implements :class:`beacon_core.ports.announcer.Announcer`; the thread rule is the port's.

    It is asked, and says nothing by itself but that something has changed: the period has no
    meaning here, and a hint is heard as often as somebody asks. An entity has a node of its own in
    each domain, ``/beacon_param_<random>/e<n>``, which has the services of parameters and nothing
    else. They can be asked, and not set.
    """

    def __init__(self, options: RmwParamOptions, period_s: float | None = None) -> None:
        """Connects in the background. ``ConfigError`` for what Zenoh refuses, for a period that is
        not above 0, and, in the modes that listen, when that is impossible."""
        period_ns(period_s)
        self.answering = threading.Lock()
        """Held while questions are answered. While somebody else holds it, nobody gets answers."""
        missed_s = max(_MISSED_AFTER_S, _MISSED_AFTER_INTERVALS * options.interval_s)
        self._missed_ns = round(missed_s * 1e9)
        self._keep_ns = round(2 * options.interval_s * 1e9)
        self._domains = options.ros_domain_ids
        self._space = f"beacon_param_{secrets.token_hex(4)}"
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._closed = False
        self._voices: dict[str, Voice] = {}
        self._news: deque[tuple[Voice, Event]] = deque()
        self._questions: deque[zenoh.Query] = deque()
        self._by_node: dict[str, Voice] = {}
        self._dropped = 0
        # The rest belongs to the keeper's thread.
        self._stands: dict[str, list[_Stand]] = {}
        self._publishers: dict[int, zenoh.Publisher] = {}
        self._ids = itertools.count(0, _IDS_PER_NODE)
        self._keeper = SessionKeeper(
            rmw_session_config(options),
            declare=self._declare,
            step=self._step,
            farewell=self._leave,
        )
        self._keeper.start()

    def announce(self, hint: BeaconHint) -> None:
        require_id(hint.entity_id, "announce: ")
        if self._keeper.forked:
            raise UsageError("announce: made before a fork; make an announcer in the child")
        parameters = write(hint)
        with self._lock:
            if self._closed:
                raise UsageError("announce: this announcer is closed; make a new one")
            voice = self._voices.get(hint.entity_id)
            if voice is None:
                voice = Voice(f"/{self._space}/e{next(self._numbers)}")
                self._voices[hint.entity_id] = self._by_node[voice.node_name] = voice
            self._news.append((voice, voice.say(parameters)))
        self._keeper.wake()

    def withdraw(self, entity_id: str) -> None:
        if self._keeper.forked:
            return
        with self._lock:
            voice = self._voices.get(entity_id)
            if self._closed or voice is None or voice.withdrawn_ns:
                return
            self._news.append((voice, voice.withdraw(time.monotonic_ns())))
        self._keeper.wake()

    def close(self) -> None:
        if self._keeper.forked:
            return
        with self._lock:
            self._closed = True
        self._keeper.close()

    def health(self) -> Health:
        voices = [one for one in list(self._voices.values()) if not one.withdrawn_ns]
        health = self._keeper.health({"entities": len(voices), "questions-dropped": self._dropped})
        if health.condition is not Condition.UP or not voices:
            return health
        asked_ns = max(one.asked_ns for one in voices)
        if asked_ns and time.monotonic_ns() - asked_ns < self._missed_ns:
            return health
        detail = (
            f"nobody asks for the parameters of {voices[0].node_name}; "
            "does the gateway have this router and this ROS domain? Ask: beacon doctor"
        )
        return Health(Condition.DOWN if asked_ns else Condition.STARTING, detail, health.counters)

    # -- in the keeper's thread ------------------------------------------------------------------

    def _declare(self, session: zenoh.Session) -> None:
        self._stands.clear()
        self._ids = itertools.count(0, _IDS_PER_NODE)
        for domain in self._domains:
            # One for all nodes, and direct, so that it has no thread: it only puts them in line.
            handler = zenoh.handlers.Callback(self._on_question, indirect=False)
            session.declare_queryable(f"{domain}/{self._space}/**", handler, complete=True)
            key = data_key(DataKey(domain, EVENTS_TOPIC, EVENTS_TYPE, EVENTS_HASH))
            # Never to wait: with a stuck subscriber somewhere it would be for 5 s, and for all.
            self._publishers[domain] = session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.DROP
            )
        for voice in list(self._voices.values()):
            self._stand_up(session, voice)

    def _step(self, session: zenoh.Session | None) -> float | None:
        if session is None:
            self._news.clear()  # whoever comes later asks
        else:
            self._tell_news(session)
        self._answer()
        return self._clear_away(time.monotonic_ns())

    def _leave(self, session: zenoh.Session) -> None:
        now_ns = time.monotonic_ns()
        with self._lock:
            voices = list(self._voices.values())
            speaking = [one for one in voices if not one.withdrawn_ns]
            self._news.extend((one, one.withdraw(now_ns)) for one in speaking)
        self._tell_news(session)
        asked = [one for one in voices if one.asked_ns > now_ns - self._missed_ns]
        deadline = time.monotonic() + _LINGER_S
        pause = threading.Event()
        while any(one.asked_ns < one.withdrawn_ns for one in asked):
            if time.monotonic() >= deadline:
                break
            pause.wait(0.005)
            self._answer()

    def _tell_news(self, session: zenoh.Session) -> None:
        while self._news:
            voice, event = self._news.popleft()
            self._stand_up(session, voice)
            payload = encode_event(event, time.time_ns())
            for stand in self._stands[voice.node_name]:
                stand.sequence += 1
                beside = attachment.encode(stand.gid, stand.sequence, time.time_ns())
                self._publishers[stand.domain].put(payload, attachment=beside)

    def _stand_up(self, session: zenoh.Session, voice: Voice) -> None:
        if voice.node_name not in self._stands:
            self._stands[voice.node_name] = [
                self._new_stand(session, voice.node_name, domain) for domain in self._domains
            ]

    def _new_stand(self, session: zenoh.Session, node_name: str, domain: int) -> _Stand:
        number = next(self._ids)
        space, _, name = node_name.rpartition("/")
        zid = str(session.zid())
        node = Member(Kind.NODE, domain, zid, number, number, name, space)
        events = events_member(node, number + 1)
        services = [
            service_member(node, number + 2 + at, service) for at, service in enumerate(SERVICES)
        ]
        declare = session.liveliness().declare_token
        # The node's own comes last: then whoever sees it can ask it.
        tokens = [declare(token_key(one)) for one in (events, *services, node)]
        return _Stand(domain, gid_of(token_key(events)), tokens)

    def _clear_away(self, now_ns: int) -> float | None:
        """Take down the nodes whose withdrawal has been seen by now. Returns when to look again."""
        with self._lock:
            withdrawn = {
                entity_id: voice for entity_id, voice in self._voices.items() if voice.withdrawn_ns
            }
            old = {
                entity_id: voice
                for entity_id, voice in withdrawn.items()
                if voice.withdrawn_ns + self._keep_ns <= now_ns
            }
            for entity_id, voice in old.items():
                del self._voices[entity_id], self._by_node[voice.node_name]
        for voice in old.values():
            _take_down(self._stands.pop(voice.node_name, ()))
        waiting = [one.withdrawn_ns for key, one in withdrawn.items() if key not in old]
        if not waiting:
            return None
        return max(0.0, (min(waiting) + self._keep_ns - now_ns) / 1e9)

    def _answer(self) -> None:
        if not self._questions:
            return
        with self.answering:
            while self._questions:
                query = self._questions.popleft()
                with query:
                    try:
                        self._answer_one(query)
                    except zenoh.ZError as error:
                        # Its session ended, or it does not take answers on this key.
                        _log.debug("a question that cannot be answered: %s", reason(error))

    def _answer_one(self, query: zenoh.Query) -> None:
        """As a service of rmw_zenoh does, which has no answer for what has no attachment."""
        asked = data_key_of(str(query.key_expr))
        beside = None if query.attachment is None else query.attachment.to_bytes()
        envelope = None if beside is None else attachment.decode(beside)
        if asked is None or envelope is None or query.payload is None:
            return
        node_name, _, service_name = asked.name.rpartition("/")
        service, voice = _KINDS.get(asked.type_name), self._by_node.get(node_name)
        if service is None or voice is None or service.name != service_name:
            return
        if len(query.payload) > _MAX_REQUEST_BYTES or asked.type_hash != service.type_hash:
            return
        said = answer(service.name, voice.parameters, query.payload.to_bytes())
        if said is None:
            return
        gid, sequence, _ = envelope
        if service.name == "list_parameters":
            voice.asked_ns = time.monotonic_ns()
        query.reply(
            query.key_expr, said, attachment=attachment.encode(gid, sequence, time.time_ns())
        )

    # -- in a receiving thread of Zenoh's --------------------------------------------------------

    def _on_question(self, query: zenoh.Query) -> None:
        if len(self._questions) >= _MAX_QUESTIONS:
            self._dropped += 1
            query.drop()  # type: ignore[no-untyped-call]
            return
        self._questions.append(query)
        self._keeper.wake()


def _take_down(stands: Iterable[_Stand]) -> None:
    for stand in stands:
        for token in reversed(stand.tokens):
            token.undeclare()  # type: ignore[no-untyped-call]
