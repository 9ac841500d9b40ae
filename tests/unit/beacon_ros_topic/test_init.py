"""The package: what it registers, and what it says when rclpy is not installed."""

from __future__ import annotations

import subprocess
import sys

import pytest

import beacon_ros_topic
from beacon_core.errors import ConfigError
from beacon_core.wire import cdr
from beacon_ros_topic import ADAPTER, RosTopicOptions


def test_the_adapter_is_complete() -> None:
    assert ADAPTER.name == "ros_topic"
    assert ADAPTER.options is RosTopicOptions
    assert ADAPTER.decode is cdr.decode
    assert ADAPTER.vendor_endpoint == "x-medkit-topic-beacon"
    assert ADAPTER.examine is not None
    for name in beacon_ros_topic.__all__:
        assert hasattr(beacon_ros_topic, name)


@pytest.mark.parametrize(
    ("make", "more"), [("source", []), ("announcer", [None]), ("examine", [1.0])]
)
def test_without_rclpy_one_sentence_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, make: str, more: list[float | None]
) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(
        ConfigError, match=r"^adapter: 'ros_topic' needs rclpy .*'beacon-core\[ros\]'"
    ):
        getattr(ADAPTER, make)(RosTopicOptions(), *more)


def test_importing_it_does_not_import_rclpy() -> None:
    script = "import beacon_ros_topic, sys; sys.exit('rclpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
