"""Hints as ROS 2 parameters of the nodes that they are about: ``ros2_medkit.discovery.*``.

Making a source or an announcer needs rclpy; importing this package does not.
See docs/adapters/ros_param.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.examination import Finding
from beacon_core.ports.source import HintSource
from beacon_core.wire import json
from beacon_ros.environment import need_rclpy
from beacon_ros_param.options import RosParamOptions

__all__ = ["ADAPTER", "RosParamOptions"]


def _source(options: RosParamOptions) -> HintSource:
    need_rclpy("ros_param")
    from beacon_ros_param.source import RosParamSource  # noqa: PLC0415 - needs what may be missing

    return RosParamSource(options)


def _announcer(options: RosParamOptions, period_s: float | None) -> Announcer:
    need_rclpy("ros_param")
    from beacon_ros_param.announcer import RosParamAnnouncer  # noqa: PLC0415 - the same

    return RosParamAnnouncer(options, period_s)


def _examine(options: RosParamOptions, seconds: float) -> Iterable[Finding]:
    need_rclpy("ros_param")
    from beacon_ros_param.examine import examine  # noqa: PLC0415 - the same

    return examine(options, seconds)


ADAPTER = Adapter(
    name="ros_param",
    options=RosParamOptions,
    decode=json.decode,
    source=_source,
    announcer=_announcer,
    default_ttl_s=15.0,
    vendor_endpoint="x-medkit-param-beacon",
    examine=_examine,
)
"""Chosen in a configuration as ``ros_param``."""
