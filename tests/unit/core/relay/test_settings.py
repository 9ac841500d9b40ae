from __future__ import annotations

import pytest

from beacon_core.errors import ConfigError
from beacon_core.relay.settings import DEFAULT_FORWARDING, Forwarding


def test_no_more_routes_than_a_digest_can_name() -> None:
    assert DEFAULT_FORWARDING.max_routes == 1000
    assert Forwarding(max_routes=4096).max_routes == 4096
    with pytest.raises(ConfigError, match="max_routes: 4097 is not possible; give 1 to 4096"):
        Forwarding(max_routes=4097)
    with pytest.raises(ConfigError, match="max_routes: 0"):
        Forwarding(max_routes=0)


def test_a_link_that_may_carry_nothing_is_refused() -> None:
    assert Forwarding(link_bytes_per_s=0.5).link_bytes_per_s == 0.5
    with pytest.raises(ConfigError, match="link_bytes_per_s: 0 is no rate; give a number above 0"):
        Forwarding(link_bytes_per_s=0)
