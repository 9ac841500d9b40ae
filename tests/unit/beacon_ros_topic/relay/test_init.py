"""What is registered for the relay: by which names, and which networks are the same one."""

from __future__ import annotations

from importlib import import_module

import pytest

from beacon_ros_topic.relay import CONDUIT, NETWORK, RosConduitOptions, RosNetworkOptions


def test_the_names_by_which_they_are_chosen() -> None:
    assert (NETWORK.name, NETWORK.options) == ("ros", RosNetworkOptions)
    assert (CONDUIT.name, CONDUIT.options) == ("ros_topic", RosConduitOptions)


def test_a_network_is_its_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    given, named = RosNetworkOptions(domain_id=7), RosNetworkOptions()
    assert NETWORK.identity(named) == NETWORK.identity(RosNetworkOptions(domain_id=0))
    assert NETWORK.identity(named) != NETWORK.identity(given)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert NETWORK.identity(named) == NETWORK.identity(given) == "ros:7"


def test_conduits_meet_by_domain_and_prefix() -> None:
    ends = [RosConduitOptions(domain_id=d, prefix=p) for d in (1, 2) for p in ("/a", "/b")]
    assert len({CONDUIT.identity(one) for one in ends}) == 4
    assert CONDUIT.identity(ends[0]) == CONDUIT.identity(RosConduitOptions("/a", 1))


def test_making_one_opens_nothing() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed: neither can be made")
    participant = import_module("beacon_ros.participant")
    # An earlier test's may be ending.
    before = set(participant._contexts)
    side = NETWORK.topic_side(RosNetworkOptions())
    conduit = CONDUIT.conduit(RosConduitOptions())
    assert set(participant._contexts) <= before
    side.close()
    conduit.close()
