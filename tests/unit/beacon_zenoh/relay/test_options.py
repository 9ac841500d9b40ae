from __future__ import annotations

from typing import Any

import cattrs
import pytest

from beacon_core.errors import ConfigError
from beacon_zenoh.relay.options import MAX_HEADER_BYTES, RelayOptions


@pytest.mark.parametrize(
    "wrong",
    [
        {"link": ""},
        {"link": "a/b"},
        {"link": "*"},
        {"link": "l" * 65},
        {"link": 7},
        {"prefix": "/beacon"},
        {"prefix": 7},
        {"send_bytes": 2 * MAX_HEADER_BYTES - 1},
        {"send_bytes": 1e9},
        {"send_bytes": "64 MB"},
        {"send_bytes": True},
        {"listen": ["nowhere"]},
    ],
)
def test_what_cannot_be_is_refused_by_name(wrong: dict[str, Any]) -> None:
    (name,) = wrong
    with pytest.raises(ConfigError, match=f"{name}:"):
        RelayOptions(**wrong)


def test_options_are_plain_data() -> None:
    options = RelayOptions(link="arm-1", send_bytes=10**6, listen=("tcp/127.0.0.1:7448",))
    converter = cattrs.Converter(forbid_extra_keys=True)
    assert converter.structure(converter.unstructure(options), RelayOptions) == options
