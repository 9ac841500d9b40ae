"""QoS strings of both who write defaults and who leave them out."""

from __future__ import annotations

import pytest

from beacon_zenoh.rmw import qos
from beacon_zenoh.rmw.qos import DEFAULT_QOS, FOREVER, Qos


@pytest.mark.parametrize(
    ("text", "profile"),
    [
        ("::,:,:,:,,", DEFAULT_QOS),
        ("1:2:1,42:9223372036,854775807:9223372036,854775807:1,9223372036,854775807", DEFAULT_QOS),
        ("::,10:,:,:,,", Qos(depth=10)),
        ("2:1:2,:0,5:1,:3,2,0", Qos(2, 1, 2, 42, (0, 5), (1, FOREVER[1]), 3, (2, 0))),
    ],
)
def test_what_is_written_is_read(text: str, profile: Qos) -> None:
    assert qos.decode(text) == profile


def test_defaults_are_left_out() -> None:
    assert qos.encode(DEFAULT_QOS) == "::,:,:,:,,"
    assert qos.encode(Qos(durability=1, depth=1)) == ":1:,1:,:,:,,"


def test_transient_local_keeps() -> None:
    assert Qos(durability=1).keeps
    assert not DEFAULT_QOS.keeps


@pytest.mark.parametrize(
    "text",
    [
        "",
        ":" * 10_000,
        "::,:,:,:,",
        "::,:,:,:,,,",
        "::,:,:,:,,:",
        "5::,:,:,:,,",
        "-1::,:,:,:,,",
        "x::,:,:,:,,",
        "\u0661::,:,:,:,,",
        "::,18446744073709551616:,:,:,,",
        " ::,:,:,:,,",
    ],
)
def test_what_is_no_profile_gives_nothing(text: str) -> None:
    assert qos.decode(text) is None
