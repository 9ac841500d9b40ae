"""Which nodes are to be heard; what else is refused is in the contract suite's list."""

from __future__ import annotations

import pytest

from beacon_zenoh.rmw import RmwOptions
from beacon_zenoh.rmw.session import rmw_session_config


def test_everybody_is_heard_unless_it_is_restricted() -> None:
    options = RmwOptions()
    assert not options.restricted
    assert options.admits("/")
    assert options.admits("/fleet/r1")


@pytest.mark.parametrize(
    ("namespace", "heard"),
    [
        ("/", False),
        ("/fleet", True),
        ("/fleet/r1", True),
        ("/fleet/test", False),
        ("/fleet/test/r1", False),
        ("/fleet2", False),
        ("/fleet/testing", True),
    ],
)
def test_a_namespace_holds_what_is_below_it(namespace: str, *, heard: bool) -> None:
    options = RmwOptions(namespaces=("/fleet",), except_namespaces=("/fleet/test",))
    assert options.restricted
    assert options.admits(namespace) is heard


def test_the_root_holds_everything() -> None:
    assert RmwOptions(namespaces=("/",)).admits("/fleet")
    assert not RmwOptions(except_namespaces=("/",)).admits("/fleet")


def test_lists_become_tuples() -> None:
    options = RmwOptions(ros_domain_ids=[0, 7], namespaces=["/fleet"])
    assert options.ros_domain_ids == (0, 7)
    assert options.namespaces == ("/fleet",)


def test_it_is_a_client_of_the_router_that_rmw_zenoh_has() -> None:
    config = rmw_session_config(RmwOptions())
    assert config.mode == "client"
    assert config.connect == ("tcp/127.0.0.1:7447",)


def test_as_a_router_it_gossips_for_nodes_find_each_other_that_way() -> None:
    config = rmw_session_config(RmwOptions(mode="router"))
    assert config.document["scouting"]["gossip"] == {"enabled": True}
    assert config.document["scouting"]["multicast"] == {"enabled": False}


def test_gossip_that_was_configured_is_left_alone() -> None:
    quiet = {"scouting": {"gossip": {"enabled": False}}}
    config = rmw_session_config(RmwOptions(mode="router", config=quiet))
    assert config.document["scouting"]["gossip"] == {"enabled": False}
