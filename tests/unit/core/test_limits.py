"""The caps: the numbers promised, how they hang together, and how a hint is weighed."""

from __future__ import annotations

import json

import attrs
import pytest

from beacon_core import limits
from beacon_core.hint import BeaconHint
from beacon_core.limits import (
    DEFAULT_LIMITS,
    HINT_OVERHEAD_BYTES,
    MAX_HINTS,
    MAX_PAYLOAD_BYTES,
    MAX_STORE_BYTES,
    HintLimits,
    hint_bytes,
)

FULL = BeaconHint(
    entity_id="x" * 256,
    stable_id="x" * 256,
    display_name="x" * 512,
    function_ids=("x" * 256,) * 100,
    depends_on=("x" * 256,) * 100,
    component_id="x" * 256,
    transport_type="x" * 512,
    negotiated_format="x" * 512,
    process_id=2**32 - 1,
    process_name="x" * 512,
    hostname="x" * 512,
    metadata={f"{n:064}": "x" * 1024 for n in range(50)},
)


def test_a_hint_may_be_as_large_as_upstream_lets_it_be() -> None:
    assert attrs.astuple(HintLimits()) == (256, 512, 100, 100, 50, 64, 1024)
    assert HintLimits() == DEFAULT_LIMITS


def test_a_hint_that_fills_every_limit_fits_into_a_payload_twice() -> None:
    text = json.dumps(attrs.asdict(FULL))
    assert 2 * len(text) < MAX_PAYLOAD_BYTES


def test_a_store_has_room_for_ten_thousand_honest_hints_of_four_kilobytes() -> None:
    assert MAX_HINTS * 4_000 <= MAX_STORE_BYTES


@pytest.mark.parametrize("name", [name for name in limits.__all__ if name.startswith("MAX_")])
def test_every_cap_is_a_whole_number_above_zero(name: str) -> None:
    value = getattr(limits, name)
    assert isinstance(value, int)
    assert value > 0


def test_a_hint_weighs_its_overhead_and_its_text() -> None:
    assert hint_bytes(BeaconHint("")) == HINT_OVERHEAD_BYTES
    assert hint_bytes(BeaconHint("abc")) == HINT_OVERHEAD_BYTES + 3


@pytest.mark.parametrize(
    "field",
    [
        "stable_id",
        "display_name",
        "component_id",
        "transport_type",
        "negotiated_format",
        "process_name",
        "hostname",
    ],
)
def test_every_string_has_its_weight(field: str) -> None:
    hint = BeaconHint(**{"entity_id": "", field: "12345"})  # type: ignore[arg-type]
    assert hint_bytes(hint) == HINT_OVERHEAD_BYTES + 5


def test_every_entry_of_a_list_and_of_the_metadata_has_its_weight() -> None:
    hint = BeaconHint("", function_ids=("1", "22"), depends_on=("333",), metadata={"4444": "55555"})
    assert hint_bytes(hint) == HINT_OVERHEAD_BYTES + 1 + 2 + 3 + 4 + 5


def test_weight_is_in_bytes_of_utf8_not_in_characters() -> None:
    assert hint_bytes(BeaconHint("", hostname="aé日\N{GRINNING FACE}")) == (
        HINT_OVERHEAD_BYTES + 1 + 2 + 3 + 4
    )


def test_a_hint_that_nobody_has_validated_can_be_weighed_too() -> None:
    assert hint_bytes(BeaconHint("", hostname="\udcff")) == HINT_OVERHEAD_BYTES + 3


def test_the_largest_hint_weighs_what_is_said_of_it() -> None:
    assert 105_000 < hint_bytes(FULL) < 112_000


def test_text_that_was_counted_before_is_not_counted_again() -> None:
    assert hint_bytes(BeaconHint("abc"), 7) == HINT_OVERHEAD_BYTES + 7
