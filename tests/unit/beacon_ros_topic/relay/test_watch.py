"""The graph is told as topics: who counts, who does not yet, and what is not a topic at all."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import attrs
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no graph")

from rclpy.qos import QoSProfile

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.marks import CONDUIT_ROLE, role
from beacon_core.relay.values import Qos, TopicType
from beacon_ros.participant import OwnNode
from beacon_ros_topic.relay import watch as watch_module
from beacon_ros_topic.relay.endpoints import (
    UNKNOWN_NODE,
    End,
    publishers_of,
    subscriptions_of,
    topics_of,
)
from beacon_ros_topic.relay.harness import BYTES, TEXT
from beacon_ros_topic.relay.nodes import MAX_MARKS, Nodes
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.watch import Speaker, Watch

if TYPE_CHECKING:
    from beacon_ros_topic.relay.harness import RosTopicSideHarness

Eventually = Callable[..., None]


class Owner:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.topics: dict[str, SeenTopic] = {}
        self.looks = 0
        self.ours: set[str] = set()

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        self.topics[topic] = seen

    def topic_gone(self, topic: str) -> None:
        del self.topics[topic]

    def looked(self) -> None:
        self.looks += 1

    def is_ours(self, node: str) -> bool:
        return node in self.ours


@pytest.fixture
def owner() -> Owner:
    return Owner()


@pytest.fixture
def watch(own: OwnNode, owner: Owner) -> Iterator[Watch]:
    made = Watch(own.node, owner, depth=10)
    yield made
    made.close()


def publish(own: OwnNode, topic: str, of: TopicType = BYTES) -> None:
    own.node.create_publisher(type_for(of), topic, QoSProfile(depth=1))


def test_the_short_way_tells_what_rclpy_tells(own: OwnNode) -> None:
    publish(own, "/topic")
    own.node.create_subscription(type_for(TEXT), "/other", print, QoSProfile(depth=1), raw=True)
    (told,) = own.node.get_publishers_info_by_topic("/topic")
    (one,) = publishers_of(own.node, "/topic")
    assert one.gid == bytes(told.endpoint_gid)
    assert one.node == own.node.get_fully_qualified_name()
    assert one.type == TopicType(told.topic_type, str(told.topic_type_hash)) == BYTES
    assert (one.reliable, one.durable, one.named) == (True, False, True)
    (other,) = subscriptions_of(own.node, "/other")
    assert other.type == TEXT
    assert publishers_of(own.node, "/other") == []


def test_what_actions_and_services_are_made_of_is_no_topic(own: OwnNode) -> None:
    for topic in (
        "/go/_action/feedback",
        "/go/_action/status",
        "/add/_service_event",
        "/go/action",
    ):
        publish(own, topic)
    assert {"/go/action", "/parameter_events"} <= set(topics_of(own.node))
    assert not [one for one in topics_of(own.node) if "/_action/" in one or "_event" in one[-6:]]


def test_what_a_conduit_publishes_is_no_topic_and_what_we_publish_neither(
    ros: RosTopicSideHarness, own: OwnNode, owner: Owner, watch: Watch, eventually: Eventually
) -> None:
    conduit, ours = OwnNode(CONDUIT_ROLE, ros.domain_id), OwnNode("ours", ros.domain_id)
    owner.ours.add(ours.node.get_fully_qualified_name())
    publish(conduit, "/frames")
    publish(ours, "/ours")
    publish(own, "/theirs")
    watch.start()
    eventually(lambda: "/theirs" in owner.topics)
    assert not {"/frames", "/ours"} & owner.topics.keys()
    conduit.close()
    ours.close()


def test_a_relays_publisher_is_known_by_its_node(
    ros: RosTopicSideHarness, owner: Owner, watch: Watch, eventually: Eventually
) -> None:
    relay = OwnNode(role((0xABC, 2)), ros.domain_id)
    publish(relay, "/topic")
    watch.start()
    eventually(lambda: "/topic" in owner.topics)
    (end,) = publishers_of(relay.node, "/topic")
    assert watch.speaker(end.gid, "/topic") == Speaker((0xABC, 2), BYTES)
    relay.close()


def test_a_speaker_that_came_since_the_last_look_is_asked_for(own: OwnNode, watch: Watch) -> None:
    publish(own, "/topic")
    (end,) = publishers_of(own.node, "/topic")
    assert watch.speaker(end.gid, "/topic") == Speaker((0, 0), BYTES)
    assert watch.speaker(end.gid, "/known by now") == Speaker((0, 0), BYTES)
    assert watch.speaker(b"somebody", "/topic") is None


def test_who_is_not_heard_for_its_type_is_told_as_long_as_it_is_there(
    ros: RosTopicSideHarness, own: OwnNode, owner: Owner, watch: Watch, eventually: Eventually
) -> None:
    for _ in range(2):
        publish(own, "/topic")
    watch.start()
    eventually(lambda: "/topic" in owner.topics)
    assert watch.remarks == {}
    other = ros.publisher("/topic", TEXT, Qos())
    eventually(lambda: "/topic" in watch.remarks)
    assert owner.topics["/topic"].type == BYTES
    assert TEXT.name in watch.remarks["/topic"]
    other.close()
    eventually(lambda: not watch.remarks)


def test_a_publisher_comes_when_its_node_is_known_or_after_half_a_second(
    own: OwnNode,
    owner: Owner,
    watch: Watch,
    eventually: Eventually,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    unnamed = {"/soon", "/never"}

    def ends(node: object, topic: str) -> list[End]:
        found = publishers_of(own.node, topic)
        name = f"/{UNKNOWN_NODE}"
        return [attrs.evolve(one, node=name) if topic in unnamed else one for one in found]

    monkeypatch.setattr(watch_module, "publishers_of", ends)
    for topic in ("/soon", "/never", "/known"):
        publish(own, topic)
    began = time.monotonic()
    watch.start()
    eventually(lambda: "/known" in owner.topics)
    assert not unnamed & owner.topics.keys() or time.monotonic() - began > 0.5
    unnamed.remove("/soon")
    eventually(lambda: "/soon" in owner.topics)
    eventually(lambda: "/never" in owner.topics)
    assert time.monotonic() - began > 0.5
    (end,) = publishers_of(own.node, "/never")
    assert watch.speaker(end.gid, "/never") == Speaker((0, 0), BYTES)


def test_it_looks_when_something_changes_and_else_hardly_ever(
    own: OwnNode, owner: Owner, watch: Watch, eventually: Eventually
) -> None:
    watch.start()
    eventually(lambda: owner.looks)
    looks = -1
    while looks != owner.looks:
        looks = owner.looks
        time.sleep(0.3)
    publish(own, "/topic")
    eventually(lambda: owner.looks > looks)


def test_there_is_a_node_for_each_mark_up_to_so_many(ros: RosTopicSideHarness) -> None:
    nodes = Nodes(ros.domain_id)
    made = {nodes.publishing((first, 1)) for first in range(MAX_MARKS + 5)}
    assert len(made - {None}) == MAX_MARKS
    assert None in made
    node = nodes.publishing((3, 1))
    assert node is not None
    assert nodes.is_ours(node.get_fully_qualified_name())
    assert not nodes.is_ours(nodes.listening.node.get_fully_qualified_name())
    nodes.close()
