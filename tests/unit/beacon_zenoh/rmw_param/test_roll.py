"""Nodes by name, with their runs and where they are asked, as it follows from the graph."""

from __future__ import annotations

from typing import Any

import attrs

from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.session import node_member
from beacon_zenoh.rmw.tokens import Member, token_key
from beacon_zenoh.rmw_param.options import RmwParamOptions
from beacon_zenoh.rmw_param.roll import GRACE_NS, Roll
from beacon_zenoh.rmw_param.services import GET, LIST, service_member

LIST_KEY = (
    f"0/arm/driver/list_parameters/rcl_interfaces::srv::dds_::ListParameters_/{LIST.type_hash}"
)
GET_KEY = f"0/arm/driver/get_parameters/rcl_interfaces::srv::dds_::GetParameters_/{GET.type_hash}"


def a_node(name: str = "driver", space: str = "/arm", zid: str = "ab", domain: int = 0) -> Member:
    return attrs.evolve(node_member(domain, zid, 5, name), namespace=space)


class World:
    """A graph, and a roll that is told of it."""

    def __init__(self, **options: Any) -> None:
        self.graph = Graph()
        self.roll = Roll(RmwParamOptions(**options))
        self.now_ns = 10**9

    def add(self, node: Member, *services: Any) -> None:
        self.graph.appeared(token_key(node))
        for number, service in enumerate(services, start=6):
            self.graph.appeared(token_key(service_member(node, number, service)))
        self.roll.came(node)

    def remove(self, node: Member) -> None:
        for key in [token_key(node), *self.graph.members_of(node.node_key)]:
            self.graph.vanished(key)
        self.roll.went(node, self.now_ns)

    def call(self) -> dict[str, set[str]]:
        return {name: set(runs) for name, runs in self.roll.call(self.graph, self.now_ns).items()}


def test_a_node_with_both_services_can_be_asked_where_its_tokens_say() -> None:
    world = World()
    world.add(a_node(), LIST, GET)
    assert world.call() == {"/arm/driver": {"ab-5"}}
    doors = world.roll.doors["/arm/driver"]
    assert (doors.list_key, doors.get_key, doors.zid) == (LIST_KEY, GET_KEY, "ab")


def test_a_node_with_other_definitions_is_asked_under_its_own_hash() -> None:
    world = World()
    world.add(a_node(), attrs.evolve(LIST, type_hash="TypeHashNotSupported"), GET)
    world.call()
    assert world.roll.doors["/arm/driver"].list_key.endswith("/TypeHashNotSupported")


def test_a_node_that_lacks_a_service_is_there_and_cannot_be_asked() -> None:
    world = World()
    world.add(a_node(), LIST)
    assert world.call() == {"/arm/driver": {"ab-5"}}
    assert not world.roll.doors


def test_hidden_nodes_and_gateways_are_asked_only_if_they_are_named() -> None:
    world = World()
    for number, name in enumerate(("driver", "_hidden", "_beacon_gateway_12")):
        world.add(a_node(name, zid=f"a{number}"), LIST, GET)
    assert len(world.call()) == 3
    assert world.roll.visible() == ["/arm/driver"]
    assert world.roll.named(["/arm/_hidden"]) == ["/arm/_hidden"]
    assert "/arm/_hidden" in world.roll.doors


def test_namespaces_that_are_not_admitted_are_not_there() -> None:
    world = World(except_namespaces=["/arm"])
    world.add(a_node(), LIST, GET)
    world.add(a_node(space="/leg", zid="cd"), LIST, GET)
    assert list(world.call()) == ["/leg/driver"]
    world.remove(a_node())
    assert list(world.call()) == ["/leg/driver"]


def test_in_several_domains_the_domain_is_part_of_the_name() -> None:
    world = World(ros_domain_ids=[0, 7])
    world.add(a_node(), LIST, GET)
    world.add(a_node(domain=7), LIST, GET)
    assert sorted(world.call()) == ["0/arm/driver", "7/arm/driver"]
    assert sorted(world.roll.visible()) == ["0/arm/driver", "7/arm/driver"]
    assert world.roll.named(["/arm/driver"]) == ["0/arm/driver", "7/arm/driver"]
    assert world.roll.missing(["/arm/driver", "/leg/driver"]) == ["/leg/driver"]


def test_two_nodes_of_one_name_have_two_runs_and_either_may_answer() -> None:
    world = World()
    world.add(a_node(zid="ab"), LIST, GET)
    world.add(a_node(zid="cd"), LIST, GET)
    assert world.call() == {"/arm/driver": {"ab-5", "cd-5"}}
    assert world.roll.doors["/arm/driver"].zid == ""


def test_a_node_that_vanishes_is_waited_for_a_moment() -> None:
    world = World()
    world.add(a_node(), LIST, GET)
    world.call()
    world.remove(a_node())
    assert world.roll.next_due_ns() == world.now_ns + GRACE_NS
    world.now_ns += GRACE_NS - 1
    assert world.call() == {"/arm/driver": {"ab-5"}}
    assert world.roll.doors["/arm/driver"].list_key == LIST_KEY
    world.now_ns += 1
    assert world.call() == {}
    assert not world.roll.doors
    assert world.roll.next_due_ns() is None


def test_a_node_that_flaps_was_never_gone() -> None:
    world = World()
    world.add(a_node(), LIST, GET)
    world.remove(a_node())
    world.add(a_node(), LIST, GET)
    assert world.roll.next_due_ns() is None
    assert world.call() == {"/arm/driver": {"ab-5"}}


def test_a_node_that_is_started_again_is_not_waited_for() -> None:
    world = World()
    world.add(a_node(zid="ab"), LIST, GET)
    world.call()
    world.remove(a_node(zid="ab"))
    world.add(a_node(zid="cd"), LIST, GET)
    assert world.call() == {"/arm/driver": {"cd-5"}}


def test_a_node_that_could_not_be_asked_cannot_be_while_it_is_waited_for() -> None:
    world = World()
    world.add(a_node())
    world.call()
    world.remove(a_node())
    assert world.call() == {"/arm/driver": {"ab-5"}}
    assert not world.roll.doors
