"""Hints as parameters of ROS 2 nodes that run rmw_zenoh, asked for with Zenoh alone.

Making a source or an announcer needs eclipse-zenoh and xxhash; importing this package does not.
See docs/adapters/zenoh_rmw.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.examination import Finding
from beacon_core.ports.source import HintSource
from beacon_core.wire import json
from beacon_zenoh.rmw.need import need_zenoh
from beacon_zenoh.rmw_param.options import RmwParamOptions

__all__ = ["ADAPTER", "RmwParamOptions"]


def _source(options: RmwParamOptions) -> HintSource:
    need_zenoh("zenoh_rmw_param")
    from beacon_zenoh.rmw_param.source import RmwParamSource  # noqa: PLC0415 - may be missing

    return RmwParamSource(options)


def _announcer(options: RmwParamOptions, period_s: float | None) -> Announcer:
    need_zenoh("zenoh_rmw_param")
    from beacon_zenoh.rmw_param.announcer import RmwParamAnnouncer  # noqa: PLC0415 - the same

    return RmwParamAnnouncer(options, period_s)


def _examine(options: RmwParamOptions, seconds: float) -> Iterable[Finding]:
    need_zenoh("zenoh_rmw_param")
    from beacon_zenoh.rmw_param.examine import examine  # noqa: PLC0415 - the same

    return examine(options, seconds)


ADAPTER = Adapter(
    name="zenoh_rmw_param",
    options=RmwParamOptions,
    decode=json.decode,
    source=_source,
    announcer=_announcer,
    default_ttl_s=15.0,
    vendor_endpoint="x-medkit-param-beacon",
    examine=_examine,
)
"""Chosen in a configuration as ``zenoh_rmw_param``."""
