"""Plain CDR: aligned as ROS aligns it, either byte order, and no length is believed."""

from __future__ import annotations

import struct

import pytest

from beacon_zenoh.rmw_param.cdr import NoMessageError, Reader, Writer


def test_numbers_begin_at_multiples_of_their_size() -> None:
    writer = Writer()
    writer.numbers("B", (1,))
    writer.numbers("q", (-2,))
    writer.numbers("I", (3,))
    writer.numbers("d", (0.5,))
    payload = writer.message()
    assert payload == b"\0\1\0\0" + struct.pack("<B7xqI4xd", 1, -2, 3, 0.5)
    reader = Reader(payload)
    assert (reader.number("B"), reader.number("q"), reader.number("I")) == (1, -2, 3)
    assert reader.floats(1) == (0.5,)


def test_sequences_without_entries_have_no_padding_for_them() -> None:
    writer = Writer()
    writer.sequence("q", ())
    writer.sequence("B", (1, 2))
    assert writer.message()[4:] == struct.pack("<IIBB", 0, 2, 1, 2)


def test_strings_end_at_a_nul() -> None:
    writer = Writer()
    writer.texts(["a\0b", "", "\ud800"])
    assert Reader(writer.message()).texts() == ["a", "", "\N{REPLACEMENT CHARACTER}"]


def test_big_endian_is_read_too() -> None:
    payload = b"\0\0\0\0" + struct.pack(">I3s", 3, b"ab\0")
    assert Reader(payload).text() == "ab"


@pytest.mark.parametrize(
    ("said", "text"), [(b"", ""), (b"ab", "ab"), (b"\xff\0", "\N{REPLACEMENT CHARACTER}")]
)
def test_what_others_write_for_a_string_is_taken(said: bytes, text: str) -> None:
    assert Reader(b"\0\1\0\0" + struct.pack("<I", len(said)) + said).text() == text


@pytest.mark.parametrize("payload", [b"", b"\0", b"\0\1\0", b"\0\3\0\0", b"\1\0\0\0\0\0\0\0"])
def test_without_a_header_of_plain_cdr_there_is_no_message(payload: bytes) -> None:
    with pytest.raises(NoMessageError):
        Reader(payload)


@pytest.mark.parametrize("read", ["text", "texts", "number"])
@pytest.mark.parametrize("payload", [b"", b"\1", b"\xff\xff\xff\xff", b"\x05\0\0\0abc"])
def test_a_length_that_is_not_there_ends_it(read: str, payload: bytes) -> None:
    reader = Reader(b"\0\1\0\0" + payload)
    with pytest.raises(NoMessageError):
        reader.number("q") if read == "number" else getattr(reader, read)()


def test_no_value_is_no_read() -> None:
    assert Reader(b"\0\1\0\0").numbers("q", 0) == ()
