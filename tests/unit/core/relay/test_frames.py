from __future__ import annotations

import struct

import attrs
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from beacon_core.relay import frames
from beacon_core.relay.frames import (
    HEADER_BYTES,
    Advertisement,
    Content,
    Digest,
    Entry,
    Frame,
    Malformed,
    Range,
    Reset,
    decode,
    encode,
    fingerprint,
)
from beacon_core.relay.values import Mode, Qos, TopicType

u64, u32 = st.integers(0, 2**64 - 1), st.integers(0, 2**32 - 1)
text = st.text(min_size=1, max_size=60).filter(lambda one: one.isprintable())
contents = st.builds(
    Content,
    u64,
    u64,
    u32,
    u64,
    st.integers(-(2**63), 2**63 - 1),
    st.binary(max_size=99),
    u64,
    st.integers(0, 255),
)


@st.composite
def adverts(draw: st.DrawFn) -> Advertisement:
    low, after = sorted((draw(u64), draw(u64)))
    return Advertisement(
        draw(u64),
        draw(u64),
        draw(u32),
        draw(u64),
        draw(u32),
        low,
        after,
        draw(text),
        TopicType(draw(text), draw(text)),
        Qos(draw(st.booleans()), draw(st.booleans()), draw(u32)),
        draw(st.sampled_from(Mode)),
        draw(st.booleans()),
        draw(st.none() | st.binary(max_size=50)),
    )


@st.composite
def digests(draw: st.DrawFn) -> Digest:
    routes = sorted(draw(st.sets(u32, max_size=5)))
    entries = tuple(Entry(one, draw(u32), *sorted((draw(u64), draw(u64)))) for one in routes)
    age = draw(st.integers(0, 2**63 - 1))
    return Digest(
        draw(u64), draw(u64), draw(u64), age, draw(st.booleans()), draw(u64), entries, draw(u64), 7
    )


resets = st.builds(
    Reset,
    u64,
    u64,
    u64,
    u64,
    st.lists(u32, max_size=5).map(tuple),
    st.booleans(),
    st.lists(st.builds(Range, u32, u64, st.integers(1, 256)), max_size=5).map(tuple),
)
anything = st.one_of(contents, adverts(), digests(), resets)


@settings(deadline=None)
@given(anything)
def test_what_is_written_is_read(frame: Frame) -> None:
    assert decode(*encode(frame)) == frame


@settings(deadline=None)
@given(contents)
def test_the_header_of_a_content_is_48_bytes_and_its_payload_is_not_copied(one: Content) -> None:
    header, payload = encode(one)
    assert len(header) == HEADER_BYTES == 48
    assert payload is one.payload
    read = decode(header, payload)
    assert isinstance(read, Content)
    assert read.payload is payload


@settings(deadline=None)
@given(st.binary(max_size=200), st.binary(max_size=9))
@example(b"", b"")
def test_any_bytes_are_a_frame_or_malformed(header: bytes, payload: bytes) -> None:
    assert isinstance(decode(header, payload), Frame | Malformed)


@settings(deadline=None)
@given(anything, st.integers(0, 400), st.integers(0, 255), st.booleans())
def test_a_spoilt_frame_is_a_frame_or_malformed(
    frame: Frame,
    at: int,
    value: int,
    cut: bool,  # noqa: FBT001
) -> None:
    header, payload = encode(frame)
    at %= len(header)
    spoilt = header[:at] if cut else header[:at] + bytes([value]) + header[at + 1 :]
    read = decode(spoilt, payload)
    assert isinstance(read, Frame | Malformed)
    if isinstance(read, Frame):
        assert encode(read) == (spoilt, payload)
    if cut:
        assert isinstance(read, Malformed)


ADVERT = Advertisement(1, 2, 3, 4, 5, 6, 7, "/n", TopicType("t", "h"), Qos(), Mode.STATE)
DIGEST = Digest(
    1, 2, 3, 4, full=True, fingerprint=5, entries=(Entry(1, 0, 0, 1), Entry(2, 0, 0, 1))
)
RESET = Reset(1, 2, 3, wanted=(1,), ranges=(Range(1, 0, 2),))
CONTENT = Content(1, 2, 3, 4, 5, b"x", 1)


def spoilt(frame: Frame, at: int, what: bytes, payload: bytes | None = None) -> str:
    header, own = encode(frame)
    header = header[:at] + what + header[at + len(what) :] if at >= 0 else header + what
    read = decode(header, own if payload is None else payload)
    assert isinstance(read, Malformed), read
    return read.reason


@pytest.mark.parametrize(
    ("reason", "found"),
    [
        ("version 9; known is 1", spoilt(CONTENT, 0, b"\x09")),
        ("kind 9 is unknown", spoilt(RESET, 1, b"\x09")),
        ("more than a content's header", spoilt(CONTENT, -1, b"x")),
        ("more than a content's header", spoilt(CONTENT, 3, b"\x01")),
        ("only contents pass more than one relay", spoilt(ADVERT, 2, b"\x01")),
        ("numbers that an advertisement has not", spoilt(ADVERT, 32, b"\x01")),
        ("numbers that a reset has not", spoilt(RESET, 32, b"\x01")),
        ("a payload where there is none", spoilt(RESET, 0, b"", b"x")),
        ("a route where there is none", spoilt(DIGEST, 20, b"\x01")),
        ("flags that are unknown", spoilt(ADVERT, 3, b"\x10")),
        ("flags that are unknown", spoilt(DIGEST, 3, b"\x02")),
        ("flags that are unknown", spoilt(RESET, 3, b"\x02")),
        ("mode 4 is unknown", spoilt(ADVERT, 68, b"\x04")),
        ("the lowest content is above the next one", spoilt(ADVERT, 52, b"\xff")),
        ("the lowest content is above the next one", spoilt(DIGEST, 76, b"\xff")),
        ("no name, no type or no hash", spoilt(attrs.evolve(ADVERT, name=""), 0, b"")),
        ("a name that is no UTF-8", spoilt(ADVERT, 74, b"\xff")),
        ("cut short", spoilt(ADVERT, 73, b"\xff")),
        ("a definition that is not announced", spoilt(ADVERT, 0, b"", b"text")),
        ("a definition that is too long", spoilt(ADVERT, 3, b"\x08", bytes(2**20 + 1))),
        ("an age below 0", spoilt(DIGEST, 39, b"\xff")),
        ("too many routes", spoilt(DIGEST, 64, b"\xff\xff")),
        ("routes out of order", spoilt(DIGEST, 68, b"\x02")),
        ("more than there should be", spoilt(DIGEST, -1, b"x")),
        ("too many questions", spoilt(RESET, 48, b"\xff\xff")),
        ("too many contents", spoilt(RESET, 68, b"\x00\x00")),
    ],
)
def test_what_is_wrong_is_told(reason: str, found: str) -> None:
    assert found == reason


def test_a_name_that_is_missing_at_the_end_is_noticed() -> None:
    header, _ = encode(ADVERT)
    assert decode(header[:-2], b"") == Malformed("cut short")


def test_a_name_that_does_not_fit_is_the_callers_mistake() -> None:
    with pytest.raises(ValueError, match="256"):
        encode(
            Advertisement(1, 2, 3, 4, 5, 6, 7, "n" * 300, TopicType("t", "h"), Qos(), Mode.STATE)
        )
    with pytest.raises(struct.error):
        encode(Reset(2**64, 0, 0))


def test_a_fingerprint_tells_routes_their_revisions_and_numbers_apart() -> None:
    some = {
        fingerprint(routes)
        for routes in (
            [],
            [(1, 0, 0)],
            [(2, 0, 0)],
            [(1, 1, 0)],
            [(1, 0, 1)],
            [(1, 0, 0), (2, 0, 0)],
        )
    }
    assert len(some) == 6
    assert max(some) < 2**64


def test_a_digest_of_all_routes_can_be_read() -> None:
    entries = tuple(Entry(n, 0, 0, 0) for n in range(frames.MAX_ENTRIES))
    full = Digest(1, 1, 1, 0, full=True, fingerprint=0, entries=entries)
    assert decode(*encode(full)) == full
