"""What is said of a carrier on which nothing is heard, with real routers and nodes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, PREFIX, write
from beacon_core.ports.examination import Finding, Level
from beacon_zenoh.harness import free_endpoint, open_router
from beacon_zenoh.rmw_param import ADAPTER, RmwParamOptions
from beacon_zenoh.rmw_param.lookalikes import ParamRobot
from beacon_zenoh.rmw_param.services import LIST

ENGINE = write(BeaconHint("engine"))


class Plant:
    """A router, and nodes on it."""

    def __init__(self) -> None:
        self.router, self.endpoint = open_router()
        self.robots: list[ParamRobot] = []

    def has(self, *args: Any, **kwargs: Any) -> ParamRobot:
        """This node is there from now on."""
        self.robots.append(ParamRobot(self.endpoint, *args, **kwargs))
        return self.robots[-1]

    def findings(self, seconds: float = 1.0, **given: Any) -> list[Finding]:
        """What is found, after the connection that always comes first."""
        options = RmwParamOptions(connect=(self.endpoint,), **given)
        assert ADAPTER.examine is not None
        connected, *others = ADAPTER.examine(options, seconds)
        assert connected == Finding(Level.OK, f"{self.endpoint}: connected")
        return others

    def findings_with(self, level: Level, what: str, **given: Any) -> list[Finding]:
        """Look again until just this is found of that level: a look ends once one node can be
        asked, when another's tokens may still be on their way."""
        deadline = time.monotonic() + 10
        while of_level(found := self.findings(**given), level) != [what]:
            assert time.monotonic() < deadline, found
        return found


@pytest.fixture
def plant() -> Iterator[Plant]:
    made = Plant()
    yield made
    for robot in made.robots:
        robot.close()
    made.router.close()


def of_level(findings: list[Finding], level: Level) -> list[str]:
    return [one.what for one in findings if one.level is level]


def test_all_is_well(plant: Plant) -> None:
    plant.has(ENGINE)
    assert plant.findings(10.0) == [
        Finding(Level.OK, "in ROS domain 0: /fleet/r1/talker"),
        Finding(Level.OK, f"{PREFIX}.* is declared by /fleet/r1/talker (engine)"),
    ]


def test_without_a_router_it_says_so() -> None:
    endpoint = free_endpoint()
    assert ADAPTER.examine is not None
    (finding,) = ADAPTER.examine(RmwParamOptions(connect=(endpoint,)), 1.0)
    assert finding.level is Level.PROBLEM
    assert finding.what == f"{endpoint}: nobody listens there"


def test_a_domain_without_nodes(plant: Plant) -> None:
    plant.has(ENGINE)
    findings = plant.findings(ros_domain_ids=[7])
    assert of_level(findings, Level.PROBLEM) == [
        "no node is in ROS domain 7",
        "in ROS domain 0, which is not listened to: 1 node",
    ]


def test_a_node_that_hangs_is_named(plant: Plant) -> None:
    plant.has(ENGINE).answers.clear()
    findings = plant.findings(timeout_s=0.3)
    assert of_level(findings, Level.PROBLEM) == [
        "no answer to list_parameters or get_parameters in 0.3 s: /fleet/r1/talker"
    ]


@pytest.mark.parametrize("service", ["list_parameters", "get_parameters"])
@pytest.mark.parametrize("said", [b"nothing", bytes(2_000_000)])
def test_an_answer_that_is_none_is_no_answer(plant: Plant, service: str, said: bytes) -> None:
    plant.has(ENGINE).said[service] = said
    (problem,) = of_level(plant.findings(timeout_s=0.3), Level.PROBLEM)
    assert problem.startswith("no answer")


def test_a_node_that_declares_nothing(plant: Plant) -> None:
    plant.has({"use_sim_time": 0})
    assert of_level(plant.findings(), Level.PROBLEM) == [f"no node declares {PREFIX}.*"]


def test_a_hint_that_is_none(plant: Plant) -> None:
    plant.has({ENTITY_ID: "no id!"})
    (problem,) = of_level(plant.findings(), Level.PROBLEM)
    assert "entity_id is no id" in problem


def test_nodes_without_services_and_targets_that_are_missing(plant: Plant) -> None:
    plant.has(ENGINE)
    plant.has(name="mute", services=(LIST,))
    targets = ["/fleet/r1/talker", "/fleet/r1/mute", "/nobody"]
    findings = plant.findings_with(
        Level.NOTE,
        "without parameter services, and so not asked: /fleet/r1/mute",
        targets=targets,
    )
    assert of_level(findings, Level.PROBLEM) == ["among the targets, but not there: /nobody"]


def test_several_nodes_of_one_name(plant: Plant) -> None:
    for _ in range(2):
        plant.has(ENGINE)
    plant.findings_with(Level.NOTE, "the name of several nodes each: /fleet/r1/talker")
