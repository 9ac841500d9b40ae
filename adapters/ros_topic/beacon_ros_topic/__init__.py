"""Hints over a ROS 2 topic, as ``ros2_medkit_msgs/msg/MedkitDiscoveryHint``.

Making a source or an announcer needs rclpy; importing this package does not.
See docs/adapters/ros_topic.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.examination import Finding
from beacon_core.ports.source import HintSource
from beacon_core.wire import cdr
from beacon_ros.environment import need_rclpy
from beacon_ros_topic.options import RosTopicOptions

__all__ = ["ADAPTER", "RosTopicOptions"]


def _source(options: RosTopicOptions) -> HintSource:
    need_rclpy("ros_topic")
    from beacon_ros_topic.source import RosTopicSource  # noqa: PLC0415 - needs what may be missing

    return RosTopicSource(options)


def _announcer(options: RosTopicOptions, period_s: float | None) -> Announcer:
    need_rclpy("ros_topic")
    from beacon_ros_topic.announcer import RosTopicAnnouncer  # noqa: PLC0415 - the same

    return RosTopicAnnouncer(options, period_s)


def _examine(options: RosTopicOptions, seconds: float) -> Iterable[Finding]:
    need_rclpy("ros_topic")
    from beacon_ros_topic.examine import examine  # noqa: PLC0415 - the same

    return examine(options, seconds)


ADAPTER = Adapter(
    name="ros_topic",
    options=RosTopicOptions,
    decode=cdr.decode,
    source=_source,
    announcer=_announcer,
    vendor_endpoint="x-medkit-topic-beacon",
    examine=_examine,
)
"""Chosen in a configuration as ``ros_topic``."""
