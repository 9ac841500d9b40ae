"""A simulated network, seeded and driven by hand: for tests, demonstrations and benches."""

from __future__ import annotations

from beacon_core.ports.adapter import Adapter
from beacon_core.wire import json
from beacon_fake.announcer import FakeAnnouncer
from beacon_fake.config import FakeOptions, find_network, share_network, unshare_network
from beacon_fake.link import LAN, LOCAL, STORM, WAN, Link
from beacon_fake.message import Kind, Message
from beacon_fake.network import FakeNetwork
from beacon_fake.source import FakeSource

__all__ = [
    "ADAPTER",
    "LAN",
    "LOCAL",
    "STORM",
    "WAN",
    "FakeAnnouncer",
    "FakeNetwork",
    "FakeOptions",
    "FakeSource",
    "Kind",
    "Link",
    "Message",
    "find_network",
    "share_network",
    "unshare_network",
]


def _source(options: FakeOptions) -> FakeSource:
    return FakeSource(find_network(options.network), options.name)


def _announcer(options: FakeOptions, period_s: float | None) -> FakeAnnouncer:
    return FakeAnnouncer(
        find_network(options.network),
        options.name,
        period_s=period_s,
        clock_offset_s=options.clock_offset_s,
    )


ADAPTER = Adapter(
    name="fake",
    options=FakeOptions,
    decode=json.decode,
    source=_source,
    announcer=_announcer,
)
"""Chosen in a configuration as ``fake``."""
