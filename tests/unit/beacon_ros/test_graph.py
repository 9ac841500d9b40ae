"""What the graph shows, in our words."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no graph")

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.type_hash import TypeHash
from unique_identifier_msgs.msg import UUID

from beacon_ros import graph
from beacon_ros.graph import Endpoint, node_names, publishers
from beacon_ros.participant import OwnNode

Eventually = Callable[..., None]

UUID_HASH = "RIHS01_1b8e8aca958cbea28fe6ef60bf6c19b683c97a9ef60bb34752067d0f2f7ab437"


@pytest.fixture
def own(domain: int) -> Iterator[OwnNode]:
    made = OwnNode("graph", domain)
    yield made
    made.close()


def test_a_publisher_is_shown_with_all_that_matters_to_who_wants_to_hear_it(own: OwnNode) -> None:
    arm = Node("driver", namespace="/arm", context=own.context, use_global_arguments=False)
    arm.create_publisher(UUID, "/ids", QoSProfile(depth=1))
    (found,) = publishers(own.node, "/ids")
    assert found == Endpoint(
        gid=found.gid,
        node="/arm/driver",
        type_name="unique_identifier_msgs/msg/UUID",
        type_hash=UUID_HASH,
        reliability="reliable",
        durability="volatile",
    )
    assert len(found.gid) == 16
    arm.destroy_node()


def test_its_qos_is_the_one_it_offers(own: OwnNode) -> None:
    own.node.create_publisher(
        UUID,
        "/ids",
        QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        ),
    )
    (found,) = publishers(own.node, "/ids")
    assert (found.reliability, found.durability) == ("best_effort", "transient_local")


def test_publishers_of_one_node_are_told_apart_and_those_that_go_are_not_shown(
    own: OwnNode, eventually: Eventually
) -> None:
    first, _ = (own.node.create_publisher(UUID, "/ids", 1) for _ in range(2))
    assert len({one.gid for one in publishers(own.node, "/ids")}) == 2
    own.node.destroy_publisher(first)
    eventually(lambda: len(publishers(own.node, "/ids")) == 1)


def test_of_a_topic_that_nobody_publishes_there_are_none(own: OwnNode) -> None:
    assert publishers(own.node, "/nothing") == []


@pytest.mark.parametrize("name", ["_NODE_NAME_UNKNOWN_", "_CREATED_BY_BARE_DDS_APP_"])
def test_who_is_not_known_has_no_name_and_who_announces_no_hash_has_none(name: str) -> None:
    info = TopicEndpointInfo(
        node_name=name,
        node_namespace=name,
        topic_type="a/msg/B",
        topic_type_hash=TypeHash(version=0),
        endpoint_gid=list(range(16)),
        qos_profile=QoSProfile(depth=1),
    )
    found = graph._endpoint(info)
    assert (found.node, found.type_hash, found.gid) == ("", "", bytes(range(16)))


def test_nodes_are_named_in_full_in_order_and_once(own: OwnNode, eventually: Eventually) -> None:
    nodes = [
        Node(name, namespace=space, context=own.context, use_global_arguments=False)
        for name, space in (("b", "/"), ("a", "/arm"), ("b", "/"))
    ]
    ours = f"/{own.node.get_name()}"
    eventually(lambda: len(own.node.get_node_names()) == 4)
    assert node_names(own.node) == sorted(["/arm/a", "/b", ours])
    for node in nodes:
        node.destroy_node()
