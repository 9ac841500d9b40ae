"""Publishers of one topic that differ are brought together, and who can hear whom is known."""

from __future__ import annotations

import attrs
import pytest

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.merging import MAX_DURABLE_DEPTH
from beacon_core.relay.values import Qos, TopicType
from beacon_zenoh.rmw import qos as rmw
from beacon_zenoh.rmw.tokens import Kind, Member
from beacon_zenoh.rmw_relay.merging import merged, reaches, rmw_qos

TEXT, IMAGE = (
    TopicType("std_msgs/msg/String", "RIHS01_1"),
    TopicType("a_msgs/msg/Image", "RIHS01_2"),
)
RELIABLE = rmw.Qos(depth=7)
BEST_EFFORT = rmw.Qos(reliability=2, depth=5)
LATCHED = rmw.Qos(durability=1, depth=1)
KEEP_ALL = rmw.Qos(history=2, depth=1)


def end(qos: rmw.Qos = RELIABLE, of: TopicType = TEXT) -> Member:
    whole = Member(Kind.PUBLISHER, 0, "1", 1, 2, "node", type_name=of.name, type_hash=of.digest)
    return attrs.evolve(whole, name="/t", qos=qos)


def qos_of(*given: rmw.Qos, before: SeenTopic | None = None, depth: int = 10) -> Qos:
    return merged([end(one) for one in given], depth, before).qos


def test_one_publisher_is_the_topic() -> None:
    assert merged([end()], 10, None) == SeenTopic(TEXT, Qos(True, False, 7))
    assert qos_of(LATCHED) == Qos(True, True, 1)
    assert qos_of(attrs.evolve(LATCHED, depth=3)) == Qos(True, True, 3)


def test_what_all_offer_is_what_the_topic_offers() -> None:
    assert qos_of(RELIABLE, BEST_EFFORT) == Qos(False, False, 7)
    assert qos_of(RELIABLE, LATCHED) == Qos(True, False, 7)
    assert qos_of(rmw.Qos(reliability=0, durability=0)).reliable


def test_of_publishers_that_keep_all_the_depth_is_what_is_configured() -> None:
    assert qos_of(KEEP_ALL, depth=33).depth == 33
    assert qos_of(KEEP_ALL, rmw.Qos(depth=50), depth=33).depth == 50
    assert qos_of(rmw.Qos(depth=0)).depth == 1


@pytest.mark.parametrize(("publishers", "depth"), [(1, 1), (2, 2), (3, 4), (30, 32)])
def test_latched_publishers_have_room_for_each_in_steps(publishers: int, depth: int) -> None:
    assert qos_of(*[LATCHED] * publishers).depth == depth


def test_a_latched_topics_depth_does_not_shrink_and_has_a_bound() -> None:
    before = SeenTopic(TEXT, Qos(True, True, 8))
    assert qos_of(LATCHED, before=before).depth == 8
    assert qos_of(LATCHED, before=SeenTopic(TEXT, Qos(True, False, 100))).depth == 1
    assert qos_of(attrs.evolve(LATCHED, depth=5000)).depth == MAX_DURABLE_DEPTH


def test_the_type_is_that_of_most_then_that_it_had_then_the_first() -> None:
    text, image = end(), end(BEST_EFFORT, IMAGE)
    assert merged([text, image, image], 10, None) == SeenTopic(IMAGE, Qos(False, False, 5))
    assert merged([text, image], 10, None).type == IMAGE
    assert merged([text, image], 10, SeenTopic(TEXT)).type == TEXT


@pytest.mark.parametrize(
    ("offered", "wanted", "heard"),
    [
        (Qos(True, True), RELIABLE, True),
        (Qos(True, False), BEST_EFFORT, True),
        (Qos(False, False), BEST_EFFORT, True),
        (Qos(False, False), RELIABLE, False),
        (Qos(True, False), LATCHED, False),
        (Qos(True, True), LATCHED, True),
    ],
)
def test_who_wants_more_than_is_offered_is_not_waited_for(
    offered: Qos, wanted: rmw.Qos, heard: object
) -> None:
    assert reaches(offered, TEXT, end(wanted)) is heard
    assert not reaches(offered, IMAGE, end(wanted))


@pytest.mark.parametrize("qos", [Qos(True, False, 10), Qos(False, True, 3)])
def test_a_token_says_what_is_offered(qos: Qos) -> None:
    assert qos_of(rmw_qos(qos)) == qos
