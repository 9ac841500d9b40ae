"""The package tells a gateway what it is, without ROS; what needs ROS says so in one sentence."""

from __future__ import annotations

import subprocess
import sys

import pytest

import beacon_ros_param
from beacon_core.errors import ConfigError
from beacon_core.ports.targeted import Targeted
from beacon_core.wire import json

WITHOUT_RCLPY = """
import sys
sys.modules["rclpy"] = None
from beacon_ros_param import ADAPTER
options = ADAPTER.options()
for make in (ADAPTER.source, lambda options: ADAPTER.announcer(options, None)):
    try:
        make(options)
    except Exception as error:
        print(f"{type(error).__name__}: {error}")
"""


def test_the_adapter_is_what_upstreams_parameter_beacon_is() -> None:
    adapter = beacon_ros_param.ADAPTER
    assert adapter.name == "ros_param"
    assert adapter.decode is json.decode
    assert adapter.default_ttl_s == 15.0
    assert adapter.vendor_endpoint == "x-medkit-param-beacon"


def test_without_rclpy_making_anything_says_what_to_install() -> None:
    command = [sys.executable, "-c", WITHOUT_RCLPY]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    lines = said.splitlines()
    assert len(lines) == 2
    for line in lines:
        assert line.startswith("ConfigError: adapter: 'ros_param' needs rclpy")
        assert "pip install 'beacon-core[ros]'" in line


def test_with_rclpy_a_source_and_an_announcer_are_made_as_told() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    adapter = beacon_ros_param.ADAPTER
    source = adapter.source(adapter.options())
    assert isinstance(source, Targeted)
    source.close()
    with pytest.raises(ConfigError, match="period_s"):
        adapter.announcer(adapter.options(), 0.0)
