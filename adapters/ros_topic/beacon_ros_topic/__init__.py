"""Hints over a ROS 2 topic, as ``ros2_medkit_msgs/msg/MedkitDiscoveryHint``.

Making a source or an announcer needs rclpy; importing this package does not.
See docs/adapters/ros_topic.md.
"""

from __future__ import annotations

from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
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


ADAPTER = Adapter(
    name="ros_topic",
    options=RosTopicOptions,
    decode=cdr.decode,
    source=_source,
    announcer=_announcer,
    vendor_endpoint="x-medkit-topic-beacon",
)
"""Chosen in a configuration as ``ros_topic``."""
