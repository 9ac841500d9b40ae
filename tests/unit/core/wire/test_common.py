"""What the wire formats share, by itself."""

from __future__ import annotations

import pytest

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_PROCESS_ID
from beacon_core.wire.common import process_id_of, split_stamp, utf8


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
