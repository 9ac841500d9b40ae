"""Hints over Zenoh: robots' processes announce, and the gateway is their router.

Making a source or an announcer needs eclipse-zenoh; importing this package does not.
See docs/adapters/zenoh.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.examination import Finding
from beacon_core.ports.source import HintSource
from beacon_core.wire import json
from beacon_zenoh.options import TlsOptions, ZenohOptions

__all__ = ["ADAPTER", "TlsOptions", "ZenohOptions"]


def _source(options: ZenohOptions) -> HintSource:
    _need_zenoh()
    from beacon_zenoh.source import ZenohSource  # noqa: PLC0415 - needs what may be missing

    return ZenohSource(options)


def _announcer(options: ZenohOptions, period_s: float | None) -> Announcer:
    _need_zenoh()
    from beacon_zenoh.announcer import ZenohAnnouncer  # noqa: PLC0415 - the same

    return ZenohAnnouncer(options, period_s)


def _examine(options: ZenohOptions, seconds: float) -> Iterable[Finding]:
    _need_zenoh()
    from beacon_zenoh.examine import examine  # noqa: PLC0415 - the same

    return examine(options, seconds)


def _need_zenoh() -> None:
    try:
        import zenoh  # noqa: F401, PLC0415 - to see whether it is there
    except ModuleNotFoundError as error:
        raise ConfigError(
            "adapter: 'zenoh' needs eclipse-zenoh; run: pip install 'beacon-core[zenoh]'"
        ) from error


ADAPTER = Adapter(
    name="zenoh",
    options=ZenohOptions,
    decode=json.decode,
    source=_source,
    announcer=_announcer,
    examine=_examine,
)
"""Chosen in a configuration as ``zenoh``."""
