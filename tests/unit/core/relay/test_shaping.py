from __future__ import annotations

import math
from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_core.relay.shaping import UNSHAPED, Shaping, is_rate


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"rate_hz": 0.0}, "rate_hz: 0.0 is no rate; give a number above 0"),
        ({"bytes_per_s": math.inf}, "bytes_per_s: inf is no rate"),
        ({"max_age_ns": 0}, "max_age_ns: 0 is not possible; give more than 0"),
        ({"priority": 8}, "priority: 8 is not possible; give 0 to 7"),
        ({"priority": -1}, "priority: -1"),
    ],
)
def test_what_cannot_be_meant_is_refused(given: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ConfigError, match=complaint):
        Shaping(**given)


def test_what_can_be_meant_is_kept() -> None:
    one = Shaping(rate_hz=0.1, bytes_per_s=1e6, max_age_ns=1, priority=7)
    assert one != UNSHAPED == Shaping()
    assert not is_rate(math.nan)
