"""ROS 2 for the relay: a network to stand beside, and a conduit over topics.

Making a topic side or a conduit needs rclpy; importing this package does not.
See docs/adapters/ros_relay.md.
"""

from __future__ import annotations

import os

from beacon_core.ports.conduit import Conduit
from beacon_core.ports.relaying import ConduitAdapter, NetworkAdapter
from beacon_core.ports.topic_side import TopicSide
from beacon_ros.environment import need_rclpy
from beacon_ros_topic.relay.options import RosConduitOptions, RosNetworkOptions

__all__ = ["CONDUIT", "NETWORK", "RosConduitOptions", "RosNetworkOptions"]

_DEFAULT_DOMAIN = "0"


def _topic_side(options: RosNetworkOptions) -> TopicSide:
    need_rclpy("ros")
    from beacon_ros_topic.relay.topic_side import (  # noqa: PLC0415 - needs what may be missing
        RosTopicSide,
    )

    return RosTopicSide(options)


def _conduit(options: RosConduitOptions) -> Conduit:
    need_rclpy("ros_topic")
    from beacon_ros_topic.relay.conduit import RosConduit  # noqa: PLC0415 - the same

    return RosConduit(options)


def _domain(domain_id: int | None) -> str:
    given = os.environ.get("ROS_DOMAIN_ID", "") if domain_id is None else str(domain_id)
    return f"ros:{given or _DEFAULT_DOMAIN}"


NETWORK = NetworkAdapter(
    name="ros",
    options=RosNetworkOptions,
    topic_side=_topic_side,
    identity=lambda options: _domain(options.domain_id),
)
"""Chosen in a configuration as ``ros``."""

CONDUIT = ConduitAdapter(
    name="ros_topic",
    options=RosConduitOptions,
    conduit=_conduit,
    identity=lambda options: f"{_domain(options.domain_id)}{options.prefix}",
)
"""Chosen in a configuration as ``ros_topic``."""
