"""What is said of QoS is what DDS does with it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no QoS")

from rclpy.qos import HistoryPolicy

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.domains import DomainLease
from beacon_ros.graph import Endpoint, publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros_topic.options import RosTopicOptions
from beacon_ros_topic.qos import misfit, profile

ALL = [
    RosTopicOptions(reliability=reliability, durability=durability, depth=1)
    for reliability in ("reliable", "best_effort")
    for durability in ("volatile", "transient_local")
]


@pytest.fixture(scope="module")
def own() -> Iterator[OwnNode]:
    with DomainLease() as lease:
        made = OwnNode("qos", lease.domain_id)
        yield made
        made.close()


def offering(reliability: str, durability: str, node: str = "/arm/driver") -> Endpoint:
    return Endpoint(b"\xab" * 16, node, TYPE_NAME, TYPE_HASH, reliability, durability)


@pytest.mark.parametrize(("here", "there"), [*itertools.product(ALL, ALL)])
def test_who_is_said_not_to_fit_is_who_is_not_connected(
    own: OwnNode,
    eventually: Callable[..., None],
    here: RosTopicOptions,
    there: RosTopicOptions,
) -> None:
    topic = f"/{here.reliability}_{here.durability}/{there.reliability}_{there.durability}"
    made = message_type(TYPE_NAME, TYPE_HASH)
    publisher = own.node.create_publisher(made, topic, profile(there))
    subscription = own.node.create_subscription(made, topic, print, profile(here), raw=True)
    eventually(lambda: own.node.count_subscribers(topic) and own.node.count_publishers(topic))
    (found,) = publishers(own.node, topic)
    assert publisher.get_subscription_count() == (misfit(here, found) == "")
    own.node.destroy_subscription(subscription)
    own.node.destroy_publisher(publisher)


def test_the_profile_says_what_the_options_say() -> None:
    made = profile(RosTopicOptions(reliability="best_effort", durability="transient_local"))
    assert (made.reliability.name, made.durability.name) == ("BEST_EFFORT", "TRANSIENT_LOCAL")
    assert (made.history, made.depth) == (HistoryPolicy.KEEP_LAST, 10_000)


def test_it_is_said_which_policy_does_not_fit_and_what_to_do() -> None:
    assert misfit(RosTopicOptions(), offering("best_effort", "volatile")) == (
        "/arm/driver is not heard: it offers reliability best_effort, this source wants reliable; "
        "set reliability: best_effort here, or reliable there"
    )


def test_who_has_no_name_is_called_by_its_gid() -> None:
    here = RosTopicOptions(durability="transient_local")
    assert misfit(here, offering("reliable", "volatile", node="")) == (
        f"{'ab' * 16} is not heard: it offers durability volatile, this source wants "
        "transient_local; set durability: volatile here, or transient_local there"
    )


def test_of_who_fits_nothing_is_said() -> None:
    assert misfit(RosTopicOptions(), offering("reliable", "transient_local")) == ""
