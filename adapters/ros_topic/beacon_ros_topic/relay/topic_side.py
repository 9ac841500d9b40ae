"""ROS 2 as the network beside a relay: topics of any type as raw bytes, installed or not.

Three threads: the caller's, which publishes; the hub's, which takes messages, and makes, counts and
ends publishers and subscriptions in the order in which that was asked for; and the watch's, which
looks at the graph.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable
from functools import partial

from beacon_core.errors import UsageError
from beacon_core.ports.topic_side import TopicWatcher
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.marks import Mark
from beacon_ros.errors import said_by_ros
from beacon_ros.taking import Buffer
from beacon_ros_topic.relay.endings import Endings
from beacon_ros_topic.relay.endpoints import subscriptions_of
from beacon_ros_topic.relay.hub import Hub
from beacon_ros_topic.relay.intake import Intake
from beacon_ros_topic.relay.nodes import Nodes
from beacon_ros_topic.relay.offer import Offer
from beacon_ros_topic.relay.options import RosNetworkOptions
from beacon_ros_topic.relay.qos import profile, reaches
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.voice import Voice
from beacon_ros_topic.relay.watch import Watch

__all__ = ["RosTopicSide"]

_log = logging.getLogger(__name__)

_CLOSE_WITHIN_S = 0.9
_LAST_WORDS_WITHIN_S = 0.3
_HELD_STEP_S = 0.01
_KEPT_BYTES = 16 * 1024 * 1024
"""Of the one buffer that all messages are taken into; a relay takes no larger ones."""
_EMPTY = (
    "a message of no bytes is not published: DDS has no such sample, and a reliable reader would "
    "wait for it, and for all that comes after it, for ever"
)


class RosTopicSide:
    """Implements :class:`beacon_core.ports.topic_side.TopicSide`; the thread rule is the port's.

    The watcher is called from two threads, never from inside a method.
    """

    def __init__(self, options: RosNetworkOptions) -> None:
        """Opens nothing."""
        self._options = options
        self._pid = os.getpid()
        self._closed = False
        self._hub: Hub | None = None
        self._offers: dict[int, Offer] = {}
        self._holding: set[int] = set()
        self._unpublished: dict[str, str] = {}
        # The rest belongs to the hub's thread.
        self._intakes: dict[int, Intake] = {}
        self._refused: dict[int, tuple[Subscribe, str]] = {}
        self._gids: set[bytes] = set()
        self._endings = Endings()
        self._buffer = Buffer(_KEPT_BYTES)

    def start(self, watcher: TopicWatcher) -> None:
        if self._closed or self._hub is not None:
            raise UsageError("start: it was started or closed already; make a new one")
        self._watcher = watcher
        self._nodes = Nodes(self._options.domain_id)
        listening = self._nodes.listening
        self._hub = Hub(listening.context, self._step, self._on_end)
        self._matched = self._hub.add(self._recount)
        self._watch = Watch(listening.node, self, self._options.depth)
        self._hub.start()
        self._watch.start()

    def subscribe(self, what: Subscribe) -> None:
        self._do(partial(self._subscribe, what))

    def unsubscribe(self, handle: int) -> None:
        self._do(partial(self._unsubscribe, handle))

    def create_publisher(self, what: CreatePublisher) -> None:
        if self._closed:
            return
        self._offers[what.handle] = offer = Offer(what)
        self._do(partial(self._endings.after, what.topic, partial(self._create, offer)))

    def publish(self, what: Publish) -> None:
        offer = self._offers.get(what.handle)
        if offer is None or self._hub is None or self._closed:
            return
        if not what.payload:
            self._refuse_empty(offer.what.topic)
            return
        try:
            if not offer.publish(what):
                self._holding.add(what.handle)
                self._hub.wake()
        except RuntimeError as error:
            self._do(partial(self._fail, offer, error))

    def destroy_publisher(self, handle: int) -> None:
        offer = self._offers.pop(handle, None)
        if offer is not None:
            self._do(
                partial(self._endings.after, offer.what.topic, partial(self._endings.begin, offer))
            )

    def close(self) -> None:
        if self._pid != os.getpid():
            return  # in a forked child, which has none of the threads
        self._closed = True
        if self._hub is not None:
            self._hub.close(_CLOSE_WITHIN_S)

    def remarks(self) -> dict[str, str]:
        """By topic: what of it is not heard or published, and why. Thread rule: any thread."""
        refused = {what.topic: why for what, why in list(self._refused.values())}
        refused |= dict(self._unpublished)
        return refused if self._hub is None else {**self._watch.remarks, **refused}

    def _refuse_empty(self, topic: str) -> None:
        if topic not in self._unpublished:
            self._unpublished[topic] = _EMPTY
            _log.warning("%s: %s", topic, _EMPTY)

    def _do(self, action: Callable[[], object]) -> None:
        if self._hub is not None:
            self._hub.do(action)

    # -- in the watch's thread -------------------------------------------------------------------

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        """For the watch."""
        self._watcher.topic_seen(topic, seen)

    def topic_gone(self, topic: str) -> None:
        """For the watch."""
        self._watcher.topic_gone(topic)

    def is_ours(self, node: str) -> bool:
        """For the watch."""
        return self._nodes.is_ours(node)

    def looked(self) -> None:
        """For the watch: who may match is counted anew."""
        node = self._nodes.listening.node
        for offer in list(self._offers.values()):
            what = offer.what
            ends = subscriptions_of(node, what.topic)
            offer.expected = sum(reaches(what.qos, what.type, one) for one in ends)
        self._matched.ring()

    # -- in the hub's thread: subscriptions ------------------------------------------------------

    def _subscribe(self, what: Subscribe) -> None:
        tell = partial(self._message, what)
        qos = profile(what.qos, self._options.queue)
        node = self._nodes.listening.node
        try:
            intake = Intake(node, type_for(what.type), what.topic, qos, self._buffer, tell)
        except Exception as error:  # noqa: BLE001 - ROS's are of many kinds, none of them public
            # Such as that this program publishes it with another type; that may end.
            if what.handle not in self._refused:
                _log.warning("%s cannot be subscribed to: %s", what.topic, _sentence(error))
            self._refused[what.handle] = (what, f"ROS refuses to subscribe: {_sentence(error)}")
            return
        self._refused.pop(what.handle, None)
        self._intakes[what.handle] = intake
        intake.open(self._the_hub)

    def _unsubscribe(self, handle: int) -> None:
        self._refused.pop(handle, None)
        intake = self._intakes.pop(handle, None)
        if intake is not None:
            intake.close()

    def _message(self, what: Subscribe, payload: bytes, gid: bytes, stamp_ns: int) -> None:
        if gid in self._gids:
            return
        speaker = self._watch.speaker(gid, what.topic)
        if speaker is None:
            self._watcher.message(what.handle, payload, stamp_ns=stamp_ns)
        elif speaker.type == what.type:
            first, hop = speaker.mark
            self._watcher.message(what.handle, payload, stamp_ns=stamp_ns, first=first, hop=hop)

    # -- in the hub's thread: publishers ---------------------------------------------------------

    def _create(self, offer: Offer) -> None:
        try:
            main = self._voice(offer, offer.mark)
        except Exception as error:  # noqa: BLE001 - as above
            self._fail(offer, error)
            return
        offer.open(main)
        what = offer.what
        ends = subscriptions_of(self._nodes.listening.node, what.topic)
        offer.expected = sum(reaches(what.qos, what.type, one) for one in ends)
        self._tell_matched(offer)

    def _voice(self, offer: Offer, mark: Mark) -> Voice:
        what = offer.what
        node = self._nodes.publishing(mark) or self._nodes.publishing(offer.mark)
        node = node or self._nodes.listening.node
        qos = profile(what.qos, 1 if what.qos.durable else self._options.queue)
        voice = Voice(node, type_for(what.type), what.topic, qos, self._matched)
        self._gids.add(voice.gid)
        return voice

    def _fail(self, offer: Offer, error: Exception) -> None:
        self._offers.pop(offer.what.handle, None)
        self._ended(offer)
        reason = f"ROS makes no publisher of {offer.what.topic}: {_sentence(error)}"
        self._watcher.publisher_failed(offer.what.handle, reason)

    def _recount(self) -> bool:
        for offer in list(self._offers.values()):
            self._tell_matched(offer)
        for what, _ in list(self._refused.values()):
            self._subscribe(what)
        return False

    def _tell_matched(self, offer: Offer) -> None:
        if not offer.made:
            return
        found = offer.count(), offer.expected
        if found != offer.told:
            offer.told = found
            self._watcher.matched(offer.what.handle, *found)

    def _step(self) -> float | None:
        wait_s = self._endings.step(self._voice, self._ended)
        for handle in list(self._holding):
            # First: what is held from now on puts it back.
            self._holding.discard(handle)
            offer = self._offers.get(handle)
            if offer is not None and self._flush(offer):
                self._holding.add(handle)
                wait_s = _HELD_STEP_S
        return wait_s

    def _flush(self, offer: Offer) -> bool:
        try:
            return offer.flush(self._voice)
        except Exception as error:  # noqa: BLE001 - as above
            self._fail(offer, error)
            return False

    def _ended(self, offer: Offer) -> None:
        self._gids.difference_update(offer.gids())
        offer.close()

    # -- at the end

    def _on_end(self) -> None:
        self._watch.close()
        for intake in self._intakes.values():
            intake.close()
        offers = [*self._offers.values(), *self._endings.offers()]
        self._say_last_words(offers)
        for offer in offers:
            offer.close()
        self._nodes.close()

    def _say_last_words(self, offers: list[Offer]) -> None:
        deadline = time.monotonic() + _LAST_WORDS_WITHIN_S
        for offer in offers:
            try:
                offer.flush(self._voice, at_once=True)
            except Exception as error:  # noqa: BLE001 - as above
                _log.warning("%s: %s", offer.what.topic, _sentence(error))
        while time.monotonic() < deadline and not all(one.acknowledged() for one in offers):
            time.sleep(_HELD_STEP_S)

    @property
    def _the_hub(self) -> Hub:
        assert self._hub is not None  # noqa: S101 - for the type checker
        return self._hub


def _sentence(error: Exception) -> str:
    """ROS's words, which may have several lines. What it keeps of them is forgotten: it would
    write both to stderr when the next thing fails."""
    said_by_ros()
    return " ".join(str(error).split()) or type(error).__name__
