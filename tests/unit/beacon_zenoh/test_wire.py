"""The attachment: our own survive the wire, and any other bytes give a value."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_zenoh.wire import MAX_INCARNATION_LENGTH, decode, encode

NAMES = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), min_size=1, max_size=64)


@settings(deadline=None)
@given(NAMES, st.integers(0, 2**64 - 1), st.integers(0, 2**63 - 1))
def test_what_is_written_is_read(incarnation: str, sequence: int, stamp_ns: int) -> None:
    assert decode(encode(incarnation, sequence, stamp_ns)) == (incarnation, sequence, stamp_ns)


def test_the_layout_is_the_documented_one() -> None:
    assert (
        encode("run-1", 3, 7) == bytes([1]) + struct.pack("<Q", 3) + struct.pack("<q", 7) + b"run-1"
    )


@settings(deadline=None)
@given(st.binary(max_size=100))
def test_any_bytes_give_an_envelope_or_nothing(attachment: bytes) -> None:
    envelope = decode(attachment)
    if envelope is not None:
        incarnation, sequence, stamp_ns = envelope
        assert 0 < len(incarnation) <= MAX_INCARNATION_LENGTH
        assert incarnation.isascii()
        assert incarnation.isprintable()
        assert sequence >= 0
        assert stamp_ns >= 0


GOOD = encode("run", 1, 1)


@pytest.mark.parametrize(
    "attachment",
    [
        pytest.param(b"", id="nothing"),
        pytest.param(GOOD[:17], id="no incarnation"),
        pytest.param(GOOD[:17] + b"i" * (MAX_INCARNATION_LENGTH + 1), id="long incarnation"),
        pytest.param(b"\x02" + GOOD[1:], id="another version"),
        pytest.param(encode("run", 1, -1), id="a stamp before 1970"),
        pytest.param(GOOD[:17] + b"r\xc3\xbcn", id="not ASCII"),
        pytest.param(GOOD[:17] + b"r\nn", id="not printable"),
    ],
)
def test_what_is_not_in_the_layout_is_nothing(attachment: bytes) -> None:
    assert decode(attachment) is None


def test_the_longest_incarnation_is_read() -> None:
    assert decode(encode("i" * MAX_INCARNATION_LENGTH, 0, 0)) == ("i" * 64, 0, 0)
