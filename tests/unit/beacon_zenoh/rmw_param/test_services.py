"""The six services have the names, types and hashes that ROS gives them."""

from __future__ import annotations

from pathlib import Path

import attrs
import pytest

from beacon_core.wire.rihs01 import type_hash
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.session import node_member
from beacon_zenoh.rmw.tokens import Kind, member_of, token_key
from beacon_zenoh.rmw_param.services import (
    EVENTS_HASH,
    EVENTS_TYPE,
    GET,
    LIST,
    SERVICES,
    Service,
    events_member,
    offered,
    service_member,
)

DEFINITIONS = Path(__file__).parents[3] / "data" / "rmw_zenoh" / "definitions"
NODE = attrs.evolve(node_member(3, "ab", 5, "talker"), namespace="/fleet/r1")


def definition(type_name: str) -> str:
    package, kind, name = type_name.split("/")
    return (DEFINITIONS / package / kind / f"{name}.{kind}").read_text("utf-8")


MESSAGES = {
    f"{path.parts[-3]}/msg/{path.stem}": path.read_text("utf-8")
    for path in DEFINITIONS.glob("*/msg/*.msg")
}


@pytest.mark.parametrize("service", SERVICES, ids=lambda one: str(one.name))
def test_the_hash_is_that_of_the_definition(service: Service) -> None:
    assert service.type_hash == type_hash(
        service.type_name, definition(service.type_name), MESSAGES
    )


def test_so_is_that_of_events() -> None:
    assert type_hash(EVENTS_TYPE, definition(EVENTS_TYPE), MESSAGES) == EVENTS_HASH


def test_a_service_has_the_key_that_was_captured() -> None:
    assert data_key(service_member(NODE, 6, LIST).data_key) == (
        "3/fleet/r1/talker/list_parameters/rcl_interfaces::srv::dds_::ListParameters_/"
        "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"
    )


@pytest.mark.parametrize("service", SERVICES, ids=lambda one: str(one.name))
def test_a_token_tells_of_it(service: Service) -> None:
    member = service_member(NODE, 6, service)
    assert member_of(token_key(member)) == member
    assert member.node_key == NODE.node_key


def test_a_node_in_no_namespace_has_its_services_at_the_root() -> None:
    assert service_member(node_member(0, "ab", 0, "n"), 1, GET).name == "/n/get_parameters"


def test_only_a_nodes_own_service_of_the_right_type_is_offered() -> None:
    own = service_member(NODE, 6, LIST)
    others = [
        events_member(NODE, 7),
        attrs.evolve(own, kind=Kind.CLIENT),
        attrs.evolve(own, name="/fleet/r2/talker/list_parameters"),
        attrs.evolve(own, type_name="std_srvs/srv/Empty"),
    ]
    assert offered(NODE, others, LIST) is None
    assert offered(NODE, [*others, own], LIST) is own
    assert offered(NODE, [own], GET) is None
