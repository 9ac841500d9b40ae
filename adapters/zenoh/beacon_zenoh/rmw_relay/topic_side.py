"""ROS 2 over Zenoh as the network beside a relay: topics of any type as raw bytes, without ROS.

Three threads, beside Zenoh's: the caller's, which declares and publishes; the keeper's, which keeps
a session and a watch on the tokens, and answers who asks for what is kept; and the teller's, which
tells the watcher all that there is to tell.
"""

from __future__ import annotations

import logging
import re
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial

import zenoh

from beacon_core.errors import UsageError
from beacon_core.ports.topic_side import TopicWatcher
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_zenoh.config import reason
from beacon_zenoh.rmw.names import is_name, is_type_name
from beacon_zenoh.rmw.session import rmw_session_config
from beacon_zenoh.rmw.tokens import Member
from beacon_zenoh.rmw.watch import Watch
from beacon_zenoh.rmw_relay.intake import Intake
from beacon_zenoh.rmw_relay.merging import merged
from beacon_zenoh.rmw_relay.offer import Offer
from beacon_zenoh.rmw_relay.options import RmwNetworkOptions
from beacon_zenoh.rmw_relay.station import Station
from beacon_zenoh.rmw_relay.teller import Teller
from beacon_zenoh.rmw_relay.topics import Topics
from beacon_zenoh.session import CLOSE_WITHIN_S, SessionKeeper

__all__ = ["DEFAULTS", "RmwTopicSide"]

_log = logging.getLogger(__name__)

DEFAULTS = {
    # A publisher that hangs must not keep a new subscription waiting for Zenoh's 10 s.
    "queries_default_timeout": 2_000,
    "transport": {
        "link": {
            "tx": {
                "queue": {
                    "congestion_control": {
                        "drop": {
                            # The numbers of the relay's conduit: 80 ms for each 64 KiB, and 3 s
                            # for all of a large message.
                            "wait_before_drop": 80_000,
                            "max_wait_before_drop_fragments": 3_000_000,
                        }
                    }
                }
            }
        }
    },
}
"""What a topic side's session is told other than those of hints."""

_GATHER_NS = 10_000_000
"""From some news to a look: of a fleet that starts, or a node with many topics, it is one look."""

_SETTLED_NS = 100_000_000
"""On a new session those who are there are reported within so long. Before, nobody is not told."""

_MAX_QUESTIONS = 1_000
"""Not yet answered. Each takes Zenoh some memory at both ends; a flood of them is dropped."""

_TELLER_WITHIN_S = 0.4
_HASH = re.compile(r"[A-Za-z0-9_]{1,80}")


class RmwTopicSide:
    """Implements :class:`beacon_core.ports.topic_side.TopicSide`; the thread rule is the port's.

    The watcher is called from one thread, never from inside a method.
    """

    def __init__(self, options: RmwNetworkOptions) -> None:
        """Opens nothing. ``ConfigError`` for what Zenoh refuses."""
        self._options = options
        self._name = secrets.token_hex(4)
        self._keeper = SessionKeeper(
            rmw_session_config(options, DEFAULTS),
            declare=self._declare,
            step=self._step,
            farewell=lambda _: None,
        )
        self._topics = Topics(self._is_ours, self._have_news)
        self._watch = Watch((options.domain_id,), self._topics, self._keeper)
        self._teller = Teller()
        # Held while something is declared, and while a new session takes over.
        self._lock = threading.Lock()
        self._stations: tuple[Station, ...] = ()
        # The present one, and that before it, of which others may still hear.
        self._intakes: dict[int, Intake] = {}
        self._offers: dict[int, Offer] = {}
        self._questions: deque[tuple[Offer, zenoh.Query]] = deque()
        self._started = self._closed = self._news = False
        self._look_at_ns = 0
        # The rest belongs to the keeper's thread.
        self._settled_ns = 0
        self._seen: dict[str, SeenTopic] = {}

    def start(self, watcher: TopicWatcher) -> None:
        """``ConfigError`` if it is to listen and cannot; ``UsageError`` for a second start."""
        if self._started or self._closed:
            raise UsageError("start: it was started or closed already; make a new one")
        self._started, self._watcher = True, watcher
        self._keeper.start()
        self._teller.start()

    def subscribe(self, what: Subscribe) -> None:
        if self._is_over() or _refusal(what):
            return
        intake = Intake(what, self._teller, self._deliver)
        with self._lock:
            self._intakes[what.handle] = intake
            self._set(lambda station: intake.open(station, self._options.domain_id))

    def unsubscribe(self, handle: int) -> None:
        with self._lock:
            intake = self._intakes.pop(handle, None)
            if intake is not None:
                self._unset(intake.close)

    def create_publisher(self, what: CreatePublisher) -> None:
        if self._is_over():
            return
        why = _refusal(what)
        if why:
            self._teller.tell(lambda: self._watcher.publisher_failed(what.handle, why))
            return
        offer = Offer(what, self._on_question, lambda _: self._have_news())
        with self._lock:
            self._offers[what.handle] = offer
            self._set(offer.open)
        self._have_news()

    def publish(self, what: Publish) -> None:
        offer = self._offers.get(what.handle)
        if offer is not None and not self._is_over():
            offer.publish(what)

    def destroy_publisher(self, handle: int) -> None:
        with self._lock:
            offer = self._offers.pop(handle, None)
            if offer is not None:
                self._unset(offer.close)

    def close(self) -> None:
        if self._keeper.forked:
            return
        deadline = time.monotonic() + CLOSE_WITHIN_S
        self._closed = True
        for intake in list(self._intakes.values()):
            intake.silence()
        self._teller.close(_TELLER_WITHIN_S)
        self._keeper.close(max(0.0, deadline - time.monotonic()))

    def _is_over(self) -> bool:
        return self._closed or self._keeper.forked

    def _set(self, opening: Callable[[Station], object]) -> None:
        """Under the lock. Without a session it is done on the next one."""
        if not self._stations:
            return
        try:
            opening(self._stations[0])
        except zenoh.ZError as error:
            _log.debug("a session ended in use: %s", reason(error))

    def _unset(self, closing: Callable[[], object]) -> None:
        """Under the lock. What was on a session that has ended has ended with it."""
        try:
            closing()
        except zenoh.ZError as error:
            _log.debug("a session ended in use: %s", reason(error))

    # -- in the keeper's thread ------------------------------------------------------------------

    def _declare(self, session: zenoh.Session) -> None:
        station = Station(session, self._options.domain_id, self._name)
        with self._lock:
            self._stations = (station, *self._stations[:1])
            for intake in self._intakes.values():
                intake.open(station, self._options.domain_id)
            for offer in self._offers.values():
                offer.open(station)
        self._settled_ns = time.monotonic_ns() + _SETTLED_NS
        self._watch.begin(session, lambda _: None)
        self._have_news()

    def _step(self, session: zenoh.Session | None) -> float | None:  # noqa: ARG002 - the keeper's
        now_ns = time.monotonic_ns()
        times = self._watch.step(now_ns), self._look(now_ns)
        self._answer()
        next_ns = min((one for one in times if one is not None), default=None)
        return None if next_ns is None else max(0.0, (next_ns - time.monotonic_ns()) / 1e9)

    def _look(self, now_ns: int) -> int | None:
        """See who has come and gone, if there are news; returns when to look again."""
        if not self._news:
            return None
        if now_ns < self._look_at_ns:
            return self._look_at_ns
        self._news = False
        for topic, publishers in self._topics.changed().items():
            self._tell_topic(topic, publishers)
        settled = now_ns >= self._settled_ns
        for offer in list(self._offers.values()):
            self._tell_matched(offer, settled=settled)
        if settled:
            return None
        self._news, self._look_at_ns = True, self._settled_ns
        return self._settled_ns

    def _tell_topic(self, topic: str, publishers: list[Member]) -> None:
        before = self._seen.get(topic)
        if not publishers:
            if before is not None:
                del self._seen[topic]
                self._teller.tell(partial(self._watcher.topic_gone, topic))
            return
        seen = merged(publishers, self._options.depth, before)
        if seen != before:
            self._seen[topic] = seen
            self._teller.tell(partial(self._watcher.topic_seen, topic, seen))

    def _tell_matched(self, offer: Offer, *, settled: bool) -> None:
        """All whom the tokens show have matched as soon as Zenoh knows one of them: the router that
        told of their tokens has been told of their subscriptions before."""
        what = offer.what
        expected = self._topics.could_have(what.topic, what.type, what.qos)
        found = (expected if offer.heard() else 0), expected
        if found == offer.told or not (settled or expected):
            return
        offer.told = found
        self._teller.tell(partial(self._watcher.matched, what.handle, *found))

    def _answer(self) -> None:
        while self._questions:
            offer, query = self._questions.popleft()
            with query:
                try:
                    offer.answer(query)
                except zenoh.ZError as error:
                    # It does not take answers on the topic's key; nobody of rmw_zenoh's asks so.
                    _log.debug("a question that cannot be answered: %s", reason(error))

    # -- in the teller's thread ------------------------------------------------------------------

    def _deliver(self, what: Subscribe, gid: bytes, payload: bytes, stamp_ns: int) -> None:
        if not any(station.owns(gid) for station in self._stations):
            first, hop = self._topics.mark(gid)
            self._watcher.message(what.handle, payload, stamp_ns=stamp_ns, first=first, hop=hop)

    # -- in threads of Zenoh's -------------------------------------------------------------------

    def _is_ours(self, member: Member) -> bool:
        return any(station.zid == member.zid for station in self._stations)

    def _have_news(self) -> None:
        if not self._news:
            self._look_at_ns = time.monotonic_ns() + _GATHER_NS
            self._news = True
        self._keeper.wake()

    def _on_question(self, offer: Offer, query: zenoh.Query) -> None:
        if len(self._questions) >= _MAX_QUESTIONS:
            query.drop()  # type: ignore[no-untyped-call]
            return
        self._questions.append((offer, query))
        self._keeper.wake()


def _refusal(what: Subscribe | CreatePublisher) -> str:
    """Why there can be no such topic; ``""`` if there can."""
    if not is_name(what.topic):
        return f"{what.topic!r} is no full name of a topic, such as /chatter"
    if not is_type_name(what.type.name):
        return f"{what.type.name!r} is no name of a ROS type, such as std_msgs/msg/Int8"
    if not _HASH.fullmatch(what.type.digest):
        right = "RIHS01_ and 64 hexadecimal digits"
        return f"{what.type.digest!r} is no hash of a ROS type: {right}"
    return ""
