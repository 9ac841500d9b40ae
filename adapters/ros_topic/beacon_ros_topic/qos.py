"""Quality of service: from options to ROS, and what does not fit."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from beacon_ros.graph import Endpoint
from beacon_ros_topic.options import RosTopicOptions

__all__ = ["misfit", "profile"]


def profile(options: RosTopicOptions) -> QoSProfile:
    """The options as rclpy wants them."""
    return QoSProfile(
        depth=options.depth,
        reliability=ReliabilityPolicy[options.reliability.upper()],
        durability=DurabilityPolicy[options.durability.upper()],
    )


def misfit(options: RosTopicOptions, publisher: Endpoint) -> str:
    """Why a source with these options cannot hear this publisher, and what to do; ``""`` if it can.

    The rule is DDS's: a publisher must offer at least what the subscriber asks for.
    """
    name = publisher.node or publisher.gid.hex()
    for policy, wanted, offered, lesser in (
        ("reliability", options.reliability, publisher.reliability, "best_effort"),
        ("durability", options.durability, publisher.durability, "volatile"),
    ):
        if offered == lesser != wanted:
            return (
                f"{name} is not heard: it offers {policy} {offered}, this source wants {wanted}; "
                f"set {policy}: {lesser} here, or {wanted} there"
            )
    return ""
