"""Publishers that differ are brought together as the table says, and who is left out is told."""

from __future__ import annotations

import itertools

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no QoS of ROS's")

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.merging import MAX_DURABLE_DEPTH
from beacon_core.relay.values import Qos, TopicType
from beacon_ros_topic.relay.endpoints import End
from beacon_ros_topic.relay.qos import (
    DECISIONS,
    merged,
    profile,
    reaches,
    remark,
)

ONE, OTHER = TopicType("a_msgs/msg/One", "RIHS01_11"), TopicType("a_msgs/msg/Other", "RIHS01_22")
NEWER = TopicType("a_msgs/msg/One", "RIHS01_33")


def end(of: TopicType = ONE, *, reliable: bool = True, durable: bool = False) -> End:
    return End(b"", "/node", of, reliable, durable)


@pytest.mark.parametrize("kinds", list(itertools.product([True, False], repeat=3)))
def test_reliable_and_durable_only_if_all_are(kinds: tuple[bool, ...]) -> None:
    qos = merged([end(reliable=one) for one in kinds], 10, None).qos
    assert qos.reliable is all(kinds)
    qos = merged([end(durable=one) for one in kinds], 10, None).qos
    assert qos.durable is all(kinds)


def test_a_volatile_topic_has_the_depth_that_is_configured() -> None:
    assert merged([end()] * 5, 7, None).qos.depth == 7


@pytest.mark.parametrize(
    ("publishers", "depth"), [(1, 1), (2, 2), (3, 4), (4, 4), (5, 8), (5000, MAX_DURABLE_DEPTH)]
)
def test_a_latched_topic_has_room_for_one_of_each_publisher(publishers: int, depth: int) -> None:
    assert merged([end(durable=True)] * publishers, 10, None).qos.depth == depth


def test_the_depth_of_a_latched_topic_does_not_shrink_while_it_is_there() -> None:
    three = merged([end(durable=True)] * 3, 10, None)
    one = merged([end(durable=True)], 10, three)
    assert one == three
    volatile = merged([end()], 10, three)
    assert merged([end(durable=True)], 10, volatile).qos.depth == 1


def test_most_publishers_decide_about_the_type() -> None:
    assert merged([end(ONE), end(OTHER), end(OTHER)], 10, None).type == OTHER
    assert merged([end(ONE), end(NEWER), end(NEWER)], 10, None).type == NEWER


def test_among_equals_the_type_stays_and_is_else_the_first_by_name() -> None:
    both = [end(OTHER), end(ONE)]
    assert merged(both, 10, None).type == ONE
    assert merged(both, 10, SeenTopic(OTHER)).type == OTHER
    assert merged(both, 10, SeenTopic(NEWER)).type == ONE


def test_only_publishers_of_that_type_decide_about_the_rest() -> None:
    ends = [end(ONE), end(ONE), end(OTHER, reliable=False)]
    assert merged(ends, 10, None).qos.reliable


def test_who_is_not_heard_is_named_with_what_is() -> None:
    ends = [end(ONE), end(ONE), end(NEWER)]
    said = remark(ends, merged(ends, 10, None))
    assert said == (
        "it has publishers of a_msgs/msg/One (RIHS01_33), which are not heard; "
        "heard is a_msgs/msg/One (RIHS01_11)"
    )
    assert remark([end(ONE)], SeenTopic(ONE)) == ""
    assert "(no hash)" in remark([end(TopicType("x/msg/X", ""))], SeenTopic(ONE))


@pytest.mark.parametrize(
    ("offered", "wanted", "fits"),
    [
        (Qos(True, True), end(), True),
        (Qos(True, True), end(durable=True), True),
        (Qos(True, False), end(durable=True), False),
        (Qos(False, False), end(), False),
        (Qos(False, False), end(reliable=False), True),
    ],
)
def test_a_publisher_must_offer_what_is_asked_for(offered: Qos, wanted: End, fits: bool) -> None:  # noqa: FBT001
    assert reaches(offered, ONE, wanted) is fits


def test_dds_matches_by_the_name_of_the_type_alone() -> None:
    assert reaches(Qos(), ONE, end(NEWER))
    assert not reaches(Qos(), ONE, end(OTHER))


def test_a_profile_says_the_same_with_the_queue_as_its_least_depth() -> None:
    ros = profile(Qos(reliable=False, durable=True, depth=5), queue=3)
    assert (ros.reliability, ros.durability) == (
        ReliabilityPolicy.BEST_EFFORT,
        DurabilityPolicy.TRANSIENT_LOCAL,
    )
    assert ros.depth == 5
    assert profile(Qos(depth=5), queue=100).depth == 100
    assert profile(Qos(), 1).durability == DurabilityPolicy.VOLATILE


def test_each_decision_has_a_reason() -> None:
    assert {"reliability", "durability", "type"} <= set(DECISIONS)
    assert all(":" in reason for reason in DECISIONS.values())
