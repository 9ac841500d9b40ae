"""ROS 2 over Zenoh beside a relay, without ROS: topics of robots that run rmw_zenoh, as raw bytes.

Making a topic side needs eclipse-zenoh and xxhash; importing this package does not.
See docs/adapters/zenoh_rmw.md.
"""

from __future__ import annotations

from beacon_core.ports.relaying import NetworkAdapter
from beacon_core.ports.topic_side import TopicSide
from beacon_zenoh.options import DEFAULT_ENDPOINT
from beacon_zenoh.rmw.need import need_zenoh
from beacon_zenoh.rmw_relay.options import RmwNetworkOptions

__all__ = ["NETWORK", "RmwNetworkOptions"]


def _topic_side(options: RmwNetworkOptions) -> TopicSide:
    need_zenoh("zenoh_rmw")
    from beacon_zenoh.rmw_relay.topic_side import (  # noqa: PLC0415 - needs what may be missing
        RmwTopicSide,
    )

    return RmwTopicSide(options)


def _identity(options: RmwNetworkOptions) -> str:
    """A domain behind another router is another network: nearly all robots have domain 0."""
    where = options.connect or options.listen or (DEFAULT_ENDPOINT,)
    return f"zenoh_rmw:{options.domain_id}@{','.join(where)}"


NETWORK = NetworkAdapter(
    name="zenoh_rmw",
    options=RmwNetworkOptions,
    topic_side=_topic_side,
    identity=_identity,
)
"""Chosen in a configuration as ``zenoh_rmw``."""
