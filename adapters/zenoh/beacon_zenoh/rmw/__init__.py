"""ROS 2 over Zenoh without ROS: robots that run rmw_zenoh, heard and spoken to with Zenoh alone.

Making a source or an announcer needs eclipse-zenoh and xxhash; importing this package does not.
See docs/adapters/zenoh_rmw.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.examination import Finding
from beacon_core.ports.source import HintSource
from beacon_core.wire import cdr
from beacon_zenoh.rmw.need import need_zenoh
from beacon_zenoh.rmw.options import RmwOptions

__all__ = ["ADAPTER", "RmwOptions"]


def _source(options: RmwOptions) -> HintSource:
    need_zenoh("zenoh_rmw")
    from beacon_zenoh.rmw.source import RmwTopicSource  # noqa: PLC0415 - needs what may be missing

    return RmwTopicSource(options)


def _announcer(options: RmwOptions, period_s: float | None) -> Announcer:
    need_zenoh("zenoh_rmw")
    from beacon_zenoh.rmw.announcer import RmwTopicAnnouncer  # noqa: PLC0415 - the same

    return RmwTopicAnnouncer(options, period_s)


def _examine(options: RmwOptions, seconds: float) -> Iterable[Finding]:
    need_zenoh("zenoh_rmw")
    from beacon_zenoh.rmw.examine import examine  # noqa: PLC0415 - the same

    return examine(options, seconds)


ADAPTER = Adapter(
    name="zenoh_rmw",
    options=RmwOptions,
    decode=cdr.decode,
    source=_source,
    announcer=_announcer,
    vendor_endpoint="x-medkit-topic-beacon",
    examine=_examine,
)
"""Chosen in a configuration as ``zenoh_rmw``."""
