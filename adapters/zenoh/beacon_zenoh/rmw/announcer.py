"""The sending half: hints as nodes that run rmw_zenoh publish and hear them."""

from __future__ import annotations

import logging
import secrets
import time
from collections import deque
from collections.abc import Sequence
from functools import partial

import attrs
import zenoh

from beacon_core.wire import cdr
from beacon_core.wire.medkit import farewell
from beacon_zenoh.config import reason
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.keys import at_most, data_key, kept_key
from beacon_zenoh.rmw.options import RmwOptions
from beacon_zenoh.rmw.qos import Qos
from beacon_zenoh.rmw.session import hint_member, node_member, rmw_session_config
from beacon_zenoh.rmw.tokens import Kind, gid_of, token_key
from beacon_zenoh.spokesman import Spokesman, Voice, Word

__all__ = ["RmwTopicAnnouncer"]

_log = logging.getLogger(__name__)

_QOS = Qos(durability=1, depth=1)
"""Reliable and transient local, the last word of each: who comes later is told."""

_MAX_QUESTIONS = 1_000
"""Not yet answered. Each takes Zenoh some memory at both ends; a flood of them is dropped."""

_Beside = tuple[bytes, zenoh.Timestamp]
"""Attachment and Zenoh's stamp. By the stamp a subscriber knows what it is told a second time: it
asks once when it begins, and once when it detects us."""


@attrs.define(eq=False)
class _Stand:
    """From where is spoken in one domain: a node with a publisher, on the present session."""

    topic_key: str
    gid: bytes
    publisher: zenoh.Publisher
    tokens: list[zenoh.LivelinessToken] = attrs.field(factory=list)
    """They live as long as somebody holds them."""
    sequence: int = 0
    last: dict[str, _Beside] = attrs.field(factory=dict)
    """What stood beside the last word about each entity, the latest at the end."""

    def say(self, session: zenoh.Session, entity_id: str, payload: bytes | None) -> None:
        """Say a hint, or (``None``) a goodbye."""
        self.sequence += 1
        beside = attachment.encode(self.gid, self.sequence, time.time_ns())
        stamp = session.new_timestamp()
        self.last.pop(entity_id, None)
        if payload is not None:
            self.last[entity_id] = beside, stamp
        else:
            payload = farewell(entity_id)
        self.publisher.put(payload, attachment=beside, timestamp=stamp)


class RmwTopicAnnouncer(Spokesman[Voice]):
    """Implements :class:`beacon_core.ports.announcer.Announcer`; the thread rule is the port's.

    For ROS it is a node with a transient-local publisher, in each of the domains. What a publisher
    keeps for who comes later would be its last messages, whatever they are about: among them old
    hints, and goodbyes. Here it is the present hint of each entity, which is asked for and answered
    in the same way, so a subscriber of rmw_zenoh cannot tell the difference.
    """

    def __init__(self, options: RmwOptions, period_s: float | None = None) -> None:
        """Connects in the background. ``ConfigError`` for what Zenoh refuses, for a period that is
        not above 0, and, in the modes that listen, when that is impossible."""
        super().__init__(rmw_session_config(options), period_s, encode=cdr.encode, voice=Voice)
        self._options = options
        self._name = f"_beacon_announcer_{secrets.token_hex(4)}"
        self._stands: list[_Stand] = []
        self._questions: deque[tuple[_Stand, zenoh.Query]] = deque()
        self._keeper.start()

    # -- in the keeper's thread ------------------------------------------------------------------

    def _begin(self, session: zenoh.Session) -> None:
        self._stands = [
            self._stand(session, domain, 2 * number)
            for number, domain in enumerate(self._options.ros_domain_ids)
        ]

    def _stand(self, session: zenoh.Session, domain: int, number: int) -> _Stand:
        zid = str(session.zid())
        node = node_member(domain, zid, number, self._name)
        member = hint_member(node, Kind.PUBLISHER, number + 1, self._options.topic, _QOS)
        token, topic_key = token_key(member), data_key(member.data_key)
        # Never to wait: with a stuck subscriber somewhere it would be for 5 s, and for all.
        publisher = session.declare_publisher(
            topic_key, congestion_control=zenoh.CongestionControl.DROP
        )
        stand = _Stand(topic_key, gid_of(token), publisher)
        kept = kept_key(topic_key, zid, number + 1)
        # Direct, so that it has no thread of its own: it only puts the question in line.
        handler = zenoh.handlers.Callback(partial(self._on_question, stand), indirect=False)
        session.declare_queryable(kept, handler)
        declare = session.liveliness().declare_token
        stand.tokens = [declare(one) for one in (token_key(node), token, kept)]
        return stand

    def _say(self, session: zenoh.Session, words: Sequence[Word]) -> None:
        for stand in self._stands:
            for entity_id, payload in words:
                stand.say(session, entity_id, payload)

    def _answer(self) -> None:
        while self._questions:
            stand, query = self._questions.popleft()
            with query:
                try:
                    self._tell(stand, query)
                except zenoh.ZError as error:
                    # It does not take answers on the topic's key; nobody of rmw_zenoh's asks so.
                    _log.debug("a question that cannot be answered: %s", reason(error))

    def _tell(self, stand: _Stand, query: zenoh.Query) -> None:
        """Say the present hints again, to whoever asks, with the numbers that they had."""
        entities = list(stand.last.items())
        for entity_id, (beside, stamp) in entities[-at_most(query.parameters.get("_max")) :]:
            voice = self._voices.get(entity_id)
            if voice is not None:
                query.reply(stand.topic_key, voice.payload, attachment=beside, timestamp=stamp)

    # -- in a receiving thread of Zenoh's --------------------------------------------------------

    def _on_question(self, stand: _Stand, query: zenoh.Query) -> None:
        if len(self._questions) >= _MAX_QUESTIONS:
            query.drop()  # type: ignore[no-untyped-call]
            return
        self._questions.append((stand, query))
        self._keeper.wake()
