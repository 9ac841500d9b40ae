"""What the environment says of ROS, told from the environment alone."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from beacon_core.ports.examination import Finding, Level
from beacon_ros import surroundings
from beacon_ros.surroundings import (
    domain,
    domain_ports,
    in_container,
    range_findings,
    which_ros,
)

CONFIGURED = "domain 3 (domain_id in the configuration)"


def ranged(**environ: str) -> list[Finding]:
    return list(range_findings(environ))


def test_the_installation_is_named_with_its_middleware(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surroundings, "version", lambda _: "7.1.5")
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    assert which_ros("rmw_x") == Finding(Level.OK, "ROS 2 jazzy, rclpy 7.1.5, rmw_x")


def test_an_installation_that_cannot_be_told_is_said_to_be_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_such(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.delenv("ROS_DISTRO", raising=False)
    monkeypatch.setattr(surroundings, "version", no_such)
    monkeypatch.setattr(surroundings, "distribution", lambda: "")
    said = which_ros("rmw_x").what
    assert said == "ROS 2 (which one cannot be told), rclpy of an unknown version, rmw_x"


@pytest.mark.parametrize(
    ("configured", "actual", "environ", "said"),
    [
        (None, 0, {}, "domain 0 (the default: ROS_DOMAIN_ID is not set)"),
        (None, 7, {"ROS_DOMAIN_ID": "7"}, "domain 7 (ROS_DOMAIN_ID=7)"),
        (7, 7, {"ROS_DOMAIN_ID": "7"}, "domain 7 (domain_id in the configuration)"),
        (0, 0, {}, "domain 0 (domain_id in the configuration)"),
        (
            3,
            3,
            {"ROS_DOMAIN_ID": "7"},
            f"{CONFIGURED}; this shell's own is another (ROS_DOMAIN_ID=7)",
        ),
        (
            3,
            3,
            {},
            f"{CONFIGURED}; this shell's own is another (ROS_DOMAIN_ID is not set)",
        ),
    ],
)
def test_the_domain_is_told_with_who_says_so(
    configured: int | None, actual: int, environ: dict[str, str], said: str
) -> None:
    assert domain(configured, actual, environ) == Finding(Level.OK, said)


def test_by_default_discovery_looks_at_the_subnet() -> None:
    assert [one.level for one in ranged()] == [Level.OK]


@pytest.mark.parametrize(
    ("value", "level", "said"),
    [
        ("SUBNET", Level.OK, "is SUBNET"),
        ("SYSTEM_DEFAULT", Level.OK, "left to the middleware"),
        ("LOCALHOST", Level.NOTE, "no other machine is seen"),
        ("OFF", Level.PROBLEM, "nobody is discovered"),
        ("localhost", Level.NOTE, "is localhost, which ROS does not know"),
    ],
)
def test_how_far_discovery_looks_is_judged(value: str, level: Level, said: str) -> None:
    (found,) = ranged(ROS_AUTOMATIC_DISCOVERY_RANGE=value)
    assert found.level is level
    assert said in found.what


def test_the_old_variable_for_this_machine_only_overrides_the_new_one() -> None:
    (found,) = ranged(ROS_LOCALHOST_ONLY="1", ROS_AUTOMATIC_DISCOVERY_RANGE="SUBNET")
    assert (found.level, found.what) == (
        Level.NOTE,
        "ROS_LOCALHOST_ONLY is 1: no other machine is seen",
    )
    (found,) = ranged(ROS_LOCALHOST_ONLY="0", ROS_AUTOMATIC_DISCOVERY_RANGE="OFF")
    assert found.level is Level.PROBLEM


@pytest.mark.parametrize(
    "name",
    [
        "ROS_STATIC_PEERS",
        "ROS_DISCOVERY_SERVER",
        "FASTDDS_BUILTIN_TRANSPORTS",
        "CYCLONEDDS_URI",
        "ZENOH_SESSION_CONFIG_URI",
    ],
)
def test_whatever_else_changes_who_is_seen_is_pointed_out(name: str) -> None:
    _, found = ranged(**{name: "value"})
    assert (found.level, found.what) == (Level.NOTE, f"{name} is value")
    assert found.advice


@pytest.mark.parametrize(
    "name", ["FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"]
)
def test_a_profile_that_is_not_there_is_a_problem(name: str, tmp_path: Path) -> None:
    there, gone = tmp_path / "there.xml", tmp_path / "gone.xml"
    there.touch()
    assert [one.level for one in ranged(**{name: str(there)})] == [Level.OK, Level.NOTE]
    found = ranged(**{name: str(gone)})[-1]
    assert found == Finding(Level.PROBLEM, f"{gone} is not there", f"correct {name}, or unset it")


def test_security_is_pointed_out_where_it_is_on() -> None:
    assert len(ranged(ROS_SECURITY_ENABLE="false")) == 1
    assert ranged(ROS_SECURITY_ENABLE="true")[1].what == "ROS_SECURITY_ENABLE is true"


@pytest.mark.parametrize(("domain_id", "ports"), [(0, "7400-7649"), (7, "9150-9399")])
def test_a_domain_has_ports_of_its_own(domain_id: int, ports: str) -> None:
    assert domain_ports(domain_id) == ports


def test_a_container_is_known_by_the_file_it_brings(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(surroundings, "_MARKS_OF_CONTAINERS", (str(tmp_path / "mark"),))
    assert not in_container()
    (tmp_path / "mark").touch()
    assert in_container()
