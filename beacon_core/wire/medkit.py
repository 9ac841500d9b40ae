"""A hint as a ROS message: its type, and the goodbye that ROS has no word for.

The bytes are those of :mod:`beacon_core.wire.cdr`, whoever carries them.

A goodbye is a hint with nothing but its entity id and a stamp from 1970, with a mark behind the
message. Typed subscribers do not see the mark: they read what they know and leave the rest. A
gateway of ros2_medkit, which knows no goodbyes, takes the age that the stamp gives, and with it the
entity for long expired, which is as near to a goodbye as it gets.
"""

from __future__ import annotations

from beacon_core.hint import BeaconHint
from beacon_core.wire import cdr

__all__ = ["GOODBYE", "NO_STAMP", "TYPE_HASH", "TYPE_NAME", "farewell", "said_goodbye"]

TYPE_NAME = "ros2_medkit_msgs/msg/MedkitDiscoveryHint"
"""What ros2_medkit's own beacons publish."""

TYPE_HASH = "RIHS01_16ec18a77a01f5e639a09c223e2eaafbfa453ad5c0bc1461ca21801371de0d24"
"""Computed by ROS from the definition; ``ros2 topic info -v`` shows it."""

GOODBYE = b"\nbeacon-goodbye\n"
"""The mark. Sixteen bytes, so that it does not change the message's padding."""

NO_STAMP = bytes(8)
"""How a message ends that gives no stamp: the stamp is its last field."""

_LONG_AGO_NS = 1


def farewell(entity_id: str) -> bytes:
    """The goodbye for this entity. Thread rule: any thread."""
    return cdr.encode(BeaconHint(entity_id), _LONG_AGO_NS) + GOODBYE


def said_goodbye(payload: bytes) -> str:
    """For whom this says goodbye; ``""`` if it does not. Any bytes in, never raises."""
    if not payload.endswith(GOODBYE):
        return ""
    read = cdr.decode(payload.removesuffix(GOODBYE))
    return getattr(getattr(read, "hint", None), "entity_id", "")
