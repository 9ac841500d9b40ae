"""The services by which nodes are asked for their parameters, and the topic on which they tell.

The hashes are those that ROS computes from its own definitions, of Jazzy; they have not changed
since Iron. Nodes with other definitions are asked under the hash that stands in their own tokens.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs

from beacon_zenoh.rmw.qos import Qos
from beacon_zenoh.rmw.tokens import Kind, Member

__all__ = [
    "EVENTS_HASH",
    "EVENTS_TOPIC",
    "EVENTS_TYPE",
    "GET",
    "LIST",
    "SERVICES",
    "Service",
    "events_member",
    "offered",
    "service_member",
]

EVENTS_TOPIC = "/parameter_events"
"""On it every node tells when its parameters change."""

EVENTS_TYPE = "rcl_interfaces/msg/ParameterEvent"
"""What is said there."""

EVENTS_HASH = "RIHS01_043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"
"""Its definition."""


@attrs.frozen
class Service:
    """One of the six that a node has."""

    name: str
    """What follows the node's name in that of the service."""
    type_name: str
    type_hash: str


LIST = Service(
    "list_parameters",
    "rcl_interfaces/srv/ListParameters",
    "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
)
"""Which parameters are there."""

GET = Service(
    "get_parameters",
    "rcl_interfaces/srv/GetParameters",
    "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
)
"""What are their values."""

SERVICES = (
    LIST,
    GET,
    Service(
        "get_parameter_types",
        "rcl_interfaces/srv/GetParameterTypes",
        "RIHS01_da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
    ),
    Service(
        "describe_parameters",
        "rcl_interfaces/srv/DescribeParameters",
        "RIHS01_845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
    ),
    Service(
        "set_parameters",
        "rcl_interfaces/srv/SetParameters",
        "RIHS01_56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
    ),
    Service(
        "set_parameters_atomically",
        "rcl_interfaces/srv/SetParametersAtomically",
        "RIHS01_0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
    ),
)
"""All of them. ROS's own clients ask nothing before all six are there."""

_QOS = Qos(depth=1000)
"""ROS's ``qos_profile_parameters`` and ``qos_profile_parameter_events``."""


def service_member(node: Member, number: int, service: Service) -> Member:
    """A service of this node, as its token says it."""
    return attrs.evolve(
        node,
        kind=Kind.SERVICE,
        member_id=number,
        name=f"{node.node_name}/{service.name}",
        type_name=service.type_name,
        type_hash=service.type_hash,
        qos=_QOS,
    )


def events_member(node: Member, number: int) -> Member:
    """This node's publisher of events."""
    return attrs.evolve(
        node,
        kind=Kind.PUBLISHER,
        member_id=number,
        name=EVENTS_TOPIC,
        type_name=EVENTS_TYPE,
        type_hash=EVENTS_HASH,
        qos=_QOS,
    )


def offered(node: Member, members: Iterable[Member], service: Service) -> Member | None:
    """The node's own service of this kind; ``None`` if it has none."""
    wanted = f"{node.node_name}/{service.name}"
    for one in members:
        if one.kind is Kind.SERVICE and one.name == wanted and one.type_name == service.type_name:
            return one
    return None
