from __future__ import annotations

import attrs

from beacon_core.relay.republishing import FrameCounts


def test_nothing_is_counted_at_first() -> None:
    assert not any(attrs.asdict(FrameCounts()).values())
