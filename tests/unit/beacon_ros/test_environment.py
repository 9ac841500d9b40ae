"""Which ROS there is, and what is said where it is not enough."""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError

import pytest

from beacon_core.errors import ConfigError
from beacon_ros import environment
from beacon_ros.environment import RAW_RMW, distribution, need_rclpy, why_no_raw_types


def test_without_rclpy_one_sentence_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(ConfigError) as refusal:
        need_rclpy("ros_topic")
    said = str(refusal.value)
    assert said.startswith("adapter: 'ros_topic' needs rclpy (")
    assert said.endswith("; source a ROS 2 installation, or run: pip install 'beacon-core[ros]'")


def test_with_rclpy_nothing_is_said() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed: there is nothing to find")
    need_rclpy("ros_topic")


def test_a_sourced_installation_says_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DISTRO", "rolling")
    assert distribution() == "rolling"


@pytest.mark.parametrize(
    ("number", "name"),
    [("7.1.5", "jazzy"), ("3.3.16", "humble"), ("9.1.2", "kilted"), ("7.10.0", ""), ("42", "")],
)
def test_wheels_are_told_by_the_version_of_rclpy(
    monkeypatch: pytest.MonkeyPatch, number: str, name: str
) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    monkeypatch.setattr(environment, "version", {"rclpy": number}.get)
    assert distribution() == name


def test_without_rclpy_there_is_no_distribution(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(package: str) -> str:
        raise PackageNotFoundError(package)

    monkeypatch.delenv("ROS_DISTRO", raising=False)
    monkeypatch.setattr(environment, "version", version)
    assert distribution() == ""


class TestRawTypes:
    @pytest.fixture(autouse=True)
    def _here(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip(
            "rclpy.utilities", reason="rclpy is not installed: it has no middleware"
        )
        self.monkeypatch = monkeypatch

    def found(self, rmw: str, distro: str) -> str:
        """What is said with this middleware of this distribution."""
        self.monkeypatch.setattr("rclpy.utilities.get_rmw_implementation_identifier", lambda: rmw)
        self.monkeypatch.setattr(environment, "distribution", lambda: distro)
        return why_no_raw_types()

    def test_they_can_be_made_for_the_default_middleware_of_jazzy(self) -> None:
        assert self.found(RAW_RMW, "jazzy") == ""

    @pytest.mark.parametrize(
        ("rmw", "distro", "found"),
        [
            ("rmw_cyclonedds_cpp", "jazzy", "rmw_cyclonedds_cpp of ROS 2 jazzy"),
            (RAW_RMW, "kilted", "rmw_fastrtps_cpp of ROS 2 kilted"),
            ("rmw_zenoh_cpp", "", "rmw_zenoh_cpp of an unknown ROS 2 distribution"),
        ],
    )
    def test_elsewhere_one_sentence_says_why_not_and_what_to_do(
        self, rmw: str, distro: str, found: str
    ) -> None:
        assert self.found(rmw, distro) == (
            "a message type can be made at run time for rmw_fastrtps_cpp of ROS 2 jazzy only, "
            f"and here is {found}; install the package ros2_medkit_msgs"
        )
