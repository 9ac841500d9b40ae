"""What ROS says of a failed call is told once."""

from __future__ import annotations

import ctypes as c

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no libraries of ROS")

from beacon_ros.errors import said_by_ros


def test_what_a_failed_call_said_is_told_and_forgotten(capfd: pytest.CaptureFixture[str]) -> None:
    assert said_by_ros() == ""
    take = c.CDLL("librcl.so").rcl_take_serialized_message
    for _ in range(2):
        take(None, None, None, None)
        assert "invalid" in said_by_ros() or "null" in said_by_ros()
        assert said_by_ros() == ""
    assert capfd.readouterr().err == ""
