"""The envelope beside a message, byte for byte."""

from __future__ import annotations

import struct

import pytest

from beacon_zenoh.rmw import attachment

GID = bytes(range(16))
WRITTEN = b"\1" + bytes(7) + b"\2" + bytes(7) + b"\x10" + GID


def test_it_is_laid_out_as_rmw_zenoh_does() -> None:
    assert attachment.encode(GID, 1, 2) == WRITTEN
    assert attachment.decode(WRITTEN) == (GID, 1, 2)


def test_numbers_below_zero_are_not_given() -> None:
    assert attachment.decode(struct.pack("<qqB", -1, -2, 16) + GID) == (GID, 0, 0)


@pytest.mark.parametrize("length", [b"\x90\0", b"\x90\x80\0", b"\x90" + b"\x80" * 8 + b"\0"])
def test_a_length_may_have_more_digits_than_it_needs(length: bytes) -> None:
    assert attachment.decode(WRITTEN[:16] + length + GID) == (GID, 1, 2)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        WRITTEN[:-1],
        WRITTEN[:16] + b"\x0f" + GID,
        WRITTEN[:16] + b"\x11" + GID + b"\0",
        WRITTEN[:16] + b"\x90\1" + GID,
        WRITTEN[:16] + b"\x90\0" + GID[:-1],
        WRITTEN[:16] + b"\x80" * 10 + GID,
        WRITTEN[:16] + b"\xff" * 17,
    ],
)
def test_anything_else_gives_nothing(data: bytes) -> None:
    assert attachment.decode(data) is None
