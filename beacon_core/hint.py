"""The hint: what a piece of robot software says about itself."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import attrs

__all__ = ["NO_METADATA", "Announcement", "BeaconHint"]

NO_METADATA: Mapping[str, str] = MappingProxyType({})
"""The metadata of a hint that gives none; shared, so that it costs nothing."""


@attrs.frozen
class BeaconHint:
    """One self-description. An empty field means "not given".

    The fields, their names and their order are those of the ROS message
    ``ros2_medkit_msgs/msg/MedkitDiscoveryHint``. Strings are UTF-8 text without lone surrogates
    and within ``beacon_core.limits`` once a hint has passed the validator; before that nothing is
    promised. Values are immutable: nobody may change ``metadata`` after the hint was made.
    """

    entity_id: str
    """Whom the hint is about: the id of an app or a component."""
    stable_id: str = ""
    """An id that survives renames, such as a serial number."""
    display_name: str = ""
    """A name for people."""
    function_ids: tuple[str, ...] = ()
    """The functions this entity takes part in."""
    depends_on: tuple[str, ...] = ()
    """The ids of entities this one cannot work without."""
    component_id: str = ""
    """The component that hosts it."""
    transport_type: str = ""
    """How its data travels, such as ``shared_memory``."""
    negotiated_format: str = ""
    """The data format agreed on, such as ``sensor_msgs/Temperature``."""
    process_id: int = 0
    """The operating system's process id, 0..2^32-1; 0 is "not given"."""
    process_name: str = ""
    hostname: str = ""
    metadata: Mapping[str, str] = NO_METADATA
    """Anything else worth showing."""


@attrs.frozen
class Announcement:
    """A hint as it was written down by its sender: what a wire format decodes into.

    What the carrier knows besides (who sent it, when it arrived, its sequence number) is not part
    of the bytes; it is handed to :meth:`beacon_core.intake.Intake.offer` beside them.
    """

    hint: BeaconHint
    stamp_ns: int = 0
    """The sender's wall clock when it spoke, in nanoseconds since 1970; 0 is "not given"."""
    repairs: tuple[str, ...] = ()
    """What the decoder had to mend, each as ``$.path: what was done``."""
