"""The receiving half: a topic's messages, with their publishers, into a sink."""

from __future__ import annotations

import logging
import os
import threading
import time

from rclpy.node import Node

from beacon_core.errors import ConfigError, UsageError
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_core.wire.medkit import GOODBYE, NO_STAMP, TYPE_HASH, TYPE_NAME, said_goodbye
from beacon_ros.graph import Endpoint, node_names, publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.reader import Reader
from beacon_ros.waiter import CONTEXT_ENDED, NODE_ENDED
from beacon_ros_topic.looks import Looks
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import misfit, profile
from beacon_ros_topic.roster import Publisher, Roster

__all__ = ["RosTopicSource"]

_log = logging.getLogger(__name__)

_CLOSE_WITHIN_S = 0.9

_NO_NUMBER = 2**64 - 1
"""What a middleware says that does not number messages."""

_SHOWN = 3
"""Publishers that cannot be heard that health names; of the others it tells the number."""


class RosTopicSource:
    """Implements :class:`beacon_core.ports.source.HintSource` and
    :class:`beacon_core.ports.graph.Graph`; the thread rules are the ports'.

    The sink's ``source`` is the GID of the publisher, in hexadecimal, and so is the incarnation: a
    publisher lives as long as the run of its process. The middleware fills in the GID, the number
    of each message and, where a message has no stamp, the time it was published; so this holds for
    any publisher in any language. Without SROS2 anybody may publish about anybody.
    """

    def __init__(self, options: RosTopicOptions, *, node: Node | None = None) -> None:
        """Opens nothing. ``node``: one of your own to join (it must live until ``close`` has
        returned, and need not be spun for this); without, it has a hidden node of its own.

        Raises ``ConfigError`` where the message type is not installed and cannot be made.
        """
        self._options = options
        self._type = message_type(TYPE_NAME, TYPE_HASH)
        self._given_node = node
        self._own: OwnNode | None = None
        self._reader: Reader | None = None
        self._closed = False
        self._ended = ""
        self._starting = threading.Lock()
        self._pid = os.getpid()
        # The rest belongs to the reader's thread; others read what is replaced as a whole.
        self._roster = Roster()
        self._known = self._roster.publishers.get
        self._looks = Looks(time.monotonic())
        self._complaints: tuple[str, ...] = ()
        self._nodes: frozenset[str] = frozenset()
        self._counters = dict.fromkeys(
            ("goodbyes", "lost", "incompatible", "matched", "sink-errors"), 0
        )

    def start(self, sink: HintSink) -> None:
        with self._starting:
            if self._closed or self._reader is not None:
                raise UsageError("start: it was started or closed already; make a new one")
            self._sink, self._offer = sink, sink.offer
            node = self._given_node
            if node is None:
                self._own = OwnNode("topic_source", self._options.domain_id)
                node = self._own.node
            self._node = node
            self._reader = self._make_reader(node)
            self._reader.start()

    def close(self) -> None:
        if self._pid != os.getpid():
            return  # in a forked child: it has none of the threads, and perhaps a lock that is held
        with self._starting:
            self._closed = True
        if self._reader is not None:
            self._reader.close(_CLOSE_WITHIN_S)

    def nodes(self) -> frozenset[str]:
        """See the port; as old as the last look at the graph, mostly two seconds at most."""
        return frozenset() if self._closed or self._ended else self._nodes

    def health(self) -> Health:
        counters = {
            **self._counters,
            "messages": self._roster.messages(),
            "publishers": len(self._roster.publishers),
            "refused": self._roster.refused,
        }
        if self._closed:
            return Health(Condition.CLOSED, counters=counters)
        if self._reader is None:
            return Health(Condition.STARTING, counters=counters)
        if self._ended:
            detail = f"{self._ended}; start the gateway again"
            return Health(Condition.DOWN, detail, counters)
        complaints = self._complaints
        if not complaints:
            return Health(Condition.UP, counters=counters)
        others = len(complaints) - _SHOWN
        more = f"; and {others} more" if others > 0 else ""
        return Health(Condition.DEGRADED, "; ".join(complaints[:_SHOWN]) + more, counters)

    def _make_reader(self, node: Node) -> Reader:
        options = self._options
        try:
            return Reader(node, self._type, options.topic, profile(options), self)
        except Exception as error:  # RCLError, which is not a public name
            if self._own is not None:
                self._own.close()
            # Its own words are "invalid allocator" for the most likely reason.
            raise ConfigError(
                f"topic: ROS refuses {options.topic!r}: {error}; "
                "does this program have a topic of that name with another type?"
            ) from error

    # -- in the reader's thread ------------------------------------------------------------------

    def on_message(self, payload: bytes, gid: bytes, sequence: int, stamp_ns: int) -> None:
        """The road of every message."""
        publisher = self._known(gid) or self._roster.meet(gid)
        publisher.messages += 1
        name = publisher.name
        number = sequence if sequence != _NO_NUMBER else 0
        try:
            if payload[-8:] != NO_STAMP:
                if payload.endswith(GOODBYE) and (entity_id := said_goodbye(payload)):
                    self._goodbye(publisher, entity_id, number)
                    return
                # One clock per sender: its own stamps may be of simulated time, the middleware's
                # never are.
                stamp_ns = 0
            outcome = self._offer(
                payload, name, stamp_ns=stamp_ns, incarnation=name, sequence=number
            )
        except Exception:  # noqa: BLE001 - sinks do not raise; one that does must not end this
            self._sink_raised()
            return
        # An unchanged hint has the very outcome of the last one.
        if outcome is not publisher.outcome:
            publisher.outcome = outcome
            if outcome.accepted:
                self._roster.spoke(gid, outcome.entity_id)

    def on_matched(self, publishers: int) -> None:
        """A publisher came or went."""
        self._counters["matched"] = publishers
        self._looks.soon(time.monotonic())

    def on_incompatible(self, total: int) -> None:
        """One came that cannot be heard."""
        self._counters["incompatible"] = total
        self._looks.soon(time.monotonic())

    def step(self) -> float:
        """Look at the graph when that is due."""
        began_s = time.monotonic()
        if self._looks.wait_s(began_s) > 0:
            return self._looks.wait_s(began_s)
        self._look(began_s)
        now_s = time.monotonic()
        self._looks.looked(began_s, now_s)
        return self._looks.wait_s(now_s)

    def on_end(self, error: str) -> None:
        """The reader has ended."""
        self._ended = error
        if error:
            # Programs end so: that is nothing to alarm anybody with.
            ordinary = error in (CONTEXT_ENDED, NODE_ENDED)
            _log.log(
                logging.INFO if ordinary else logging.ERROR, "%s: %s", self._options.topic, error
            )
        if self._own is not None:
            self._own.close()

    def _look(self, now_s: float) -> None:
        names = frozenset(node_names(self._node))
        if names != self._nodes:
            self._nodes = names
        listed = publishers(self._node, self._options.topic)
        for publisher in self._roster.gone((one.gid for one in listed), now_s):
            for entity_id in publisher.entities:
                self._lose(publisher, entity_id)
        self._complain(listed)

    def _complain(self, listed: list[Endpoint]) -> None:
        complaints = tuple(
            complaint for one in listed if (complaint := self._complaint(one)) is not None
        )
        for complaint in complaints:
            if complaint not in self._complaints:
                _log.warning("%s: %s", self._options.topic, complaint)
        self._complaints = complaints

    def _complaint(self, publisher: Endpoint) -> str | None:
        if publisher.type_name != TYPE_NAME:
            name = publisher.node or publisher.gid.hex()
            return f"{name} is not heard: it publishes {publisher.type_name}, not {TYPE_NAME}"
        return misfit(self._options, publisher) or None

    def _goodbye(self, publisher: Publisher, entity_id: str, sequence: int) -> None:
        self._counters["goodbyes"] += 1
        self._roster.left(publisher, entity_id)
        name = publisher.name
        self._sink.goodbye(entity_id, name, incarnation=name, sequence=sequence)

    def _lose(self, publisher: Publisher, entity_id: str) -> None:
        if self._closed:
            return
        self._counters["lost"] += 1
        name, why = publisher.name, "its publisher left the ROS graph without a goodbye"
        try:
            self._sink.lost(entity_id, name, incarnation=name, reason=why)
        except Exception:  # noqa: BLE001 - as above
            self._sink_raised()

    def _sink_raised(self) -> None:
        self._counters["sink-errors"] += 1
        _log.exception("the sink raised")
