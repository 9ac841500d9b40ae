"""What is said of a carrier on which nothing is heard, with real routers and tokens."""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import pytest
import zenoh

from beacon_core.ports.examination import Finding, Level
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.harness import free_endpoint, open_router
from beacon_zenoh.rmw import ADAPTER, RmwOptions
from beacon_zenoh.rmw.qos import DEFAULT_QOS
from beacon_zenoh.rmw.session import hint_member, node_member
from beacon_zenoh.rmw.tokens import Kind, Member, token_key

TOPIC = "/ros2_medkit/discovery"
TALKER = attrs.evolve(node_member(0, "ab", 0, "talker"), namespace="/fleet")
HINTS = hint_member(TALKER, Kind.PUBLISHER, 1, TOPIC, DEFAULT_QOS)


class Plant:
    """A router, and tokens on it."""

    def __init__(self) -> None:
        self.router, self.endpoint = open_router()
        self._tokens: list[zenoh.LivelinessToken] = []

    def has(self, *members: Member) -> None:
        """These are there from now on."""
        declare = self.router.liveliness().declare_token
        self._tokens += [declare(token_key(member)) for member in members]

    def findings(self, seconds: float = 0.5, **given: object) -> list[Finding]:
        """What is found, after the connection that always comes first."""
        options = RmwOptions(connect=(self.endpoint,), **given)  # type: ignore[arg-type]
        assert ADAPTER.examine is not None
        connected, *others = ADAPTER.examine(options, seconds)
        assert connected == Finding(Level.OK, f"{self.endpoint}: connected")
        return others


@pytest.fixture
def plant() -> Iterator[Plant]:
    made = Plant()
    yield made
    made.router.close()


def test_all_is_well(plant: Plant) -> None:
    plant.has(TALKER, HINTS)
    assert plant.findings(10.0) == [
        Finding(Level.OK, "in ROS domain 0: /fleet/talker"),
        Finding(Level.OK, f"hints on {TOPIC} come from /fleet/talker"),
    ]


def test_without_a_router_it_says_so() -> None:
    endpoint = free_endpoint()
    assert ADAPTER.examine is not None
    (finding,) = ADAPTER.examine(RmwOptions(connect=(endpoint,)), 1.0)
    assert finding.level is Level.PROBLEM
    assert finding.what == f"{endpoint}: nobody listens there"


def test_a_domain_without_nodes(plant: Plant) -> None:
    (finding,) = plant.findings(ros_domain_ids=(7,))
    assert finding.level is Level.PROBLEM
    assert finding.what == "no node is in ROS domain 7"
    assert "ROS_DOMAIN_ID=7" in finding.advice


def test_one_of_several_domains_may_be_empty(plant: Plant) -> None:
    plant.has(TALKER, HINTS)
    findings = plant.findings(ros_domain_ids=(0, 7))
    assert [one.level for one in findings] == [Level.OK, Level.NOTE, Level.OK]


def test_gateways_are_no_robots(plant: Plant) -> None:
    plant.has(node_member(0, "cd", 0, "_beacon_gateway_1234"))
    (finding,) = plant.findings()
    assert finding.what == "no node is in ROS domain 0"


@pytest.mark.parametrize(("ours", "level"), [((0,), Level.NOTE), ((3,), Level.PROBLEM)])
def test_nodes_in_another_domain(plant: Plant, ours: tuple[int, ...], level: Level) -> None:
    plant.has(TALKER, HINTS)
    plant.has(*(node_member(7, "ef", number, f"node_{number}") for number in range(2)))
    findings = plant.findings(ros_domain_ids=ours)
    other = Finding(
        level,
        "in ROS domain 7, which is not listened to: 2 nodes",
        f"to hear them: ros_domain_ids: [{ours[0]}, 7]",
    )
    assert other in findings


def test_nodes_that_have_no_beacon(plant: Plant) -> None:
    plant.has(TALKER)
    findings = plant.findings()
    assert findings[-1].level is Level.PROBLEM
    assert findings[-1].what == f"no node publishes on {TOPIC}"


def test_namespaces_that_are_not_admitted(plant: Plant) -> None:
    plant.has(TALKER, HINTS)
    findings = plant.findings(except_namespaces=("/fleet",))
    assert findings[-1].level is Level.NOTE
    assert findings[-1].what == "not heard, as their namespaces are not admitted: /fleet/talker"


def test_another_definition_and_another_type(plant: Plant) -> None:
    old = attrs.evolve(HINTS, type_hash="RIHS01_0", member_id=2)
    text = attrs.evolve(HINTS, type_name="std_msgs/msg/String", member_id=3)
    plant.has(TALKER, HINTS, old, text)
    findings = plant.findings()
    assert Finding(Level.OK, f"hints on {TOPIC} come from /fleet/talker") in findings
    assert {(one.level, one.what) for one in findings[2:]} == {
        (Level.NOTE, "/fleet/talker has another definition of the message: RIHS01_0"),
        (
            Level.PROBLEM,
            f"/fleet/talker is not heard: it publishes std_msgs/msg/String, not {TYPE_NAME}",
        ),
    }
    assert any(TYPE_HASH in one.advice for one in findings)


def test_what_is_no_token_of_rmw_zenoh_is_passed_over(plant: Plant) -> None:
    plant.has(TALKER, HINTS)
    strange = plant.router.liveliness().declare_token("@ros2_lv/0/what/is/this")
    assert len(plant.findings()) == 2
    strange.undeclare()
