"""What the wire formats share, by itself."""

from __future__ import annotations

import pytest

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_LOG_CHARS, MAX_REPAIRS
from beacon_core.wire.repairs import (
    MAX_PROCESS_ID,
    Repairs,
    mended,
    place,
    process_id_of,
    split_stamp,
    utf8,
)


def test_repairs_come_out_as_they_went_in() -> None:
    repairs = Repairs()
    assert repairs.all() == ()
    for number in range(MAX_REPAIRS):
        repairs.add(f"$.depends_on[{number}]", "dropped")
    assert len(repairs.all()) == MAX_REPAIRS
    assert repairs.all()[-1] == f"$.depends_on[{MAX_REPAIRS - 1}]: dropped"


def test_one_repair_too_many_turns_the_last_into_a_count() -> None:
    repairs = Repairs()
    for _ in range(MAX_REPAIRS + 1):
        repairs.add("$.depends_on", "dropped")
    assert len(repairs.all()) == MAX_REPAIRS
    assert repairs.all()[-1] == "... and 2 more"


def test_a_place_names_a_field_or_an_entry_of_it() -> None:
    assert place("hostname") == "$.hostname"
    assert place("depends_on", 3) == "$.depends_on[3]"
    assert place("metadata", "key-1") == "$.metadata.key-1"


def test_a_foreign_key_in_a_place_is_escaped_and_short() -> None:
    assert place("metadata", "a\n\x1b") == "$.metadata['a\\n\\x1b']"
    assert len(place("metadata", "\n" * 10_000)) <= MAX_LOG_CHARS + len("$.metadata[]")


def test_only_lone_surrogates_are_mended() -> None:
    assert mended("a\ud800\udfff🌡") == "a\ufffd\ufffd🌡"
    assert mended("é\0") == "é\0"


def test_any_text_has_bytes() -> None:
    assert utf8("é") == "é".encode()
    assert utf8("\ud800") == b"\xef\xbf\xbd"


def test_a_process_id_within_32_bits_passes_and_others_are_refused() -> None:
    assert process_id_of(BeaconHint("e", process_id=MAX_PROCESS_ID)) == MAX_PROCESS_ID
    with pytest.raises(UsageError, match=r"process_id=-1: expected 0\.\.4294967295"):
        process_id_of(BeaconHint("e", process_id=-1))


def test_a_stamp_is_split_and_one_that_does_not_fit_is_refused() -> None:
    assert split_stamp(5_000_000_007, 5) == (5, 7)
    with pytest.raises(UsageError, match=r"stamp_ns=6000000000: .* 0\.\.5999999999"):
        split_stamp(6_000_000_000, 5)
    with pytest.raises(UsageError, match="stamp_ns=-1"):
        split_stamp(-1, 5)
