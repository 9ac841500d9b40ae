"""Properties of both wire formats, for any hint and any bytes."""

from __future__ import annotations

import json as std_json
from collections.abc import Callable

import attrs
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.limits import MAX_REPAIRS
from beacon_core.ports.adapter import Decoder, Malformed
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.testing.strategies import hints, hostile_payloads, ids, raw_hints, stamps
from beacon_core.wire import cdr, json

OFTEN = settings(max_examples=500, deadline=None)
SELDOM = settings(max_examples=50, deadline=None)

ENCODERS: list[tuple[Callable[[BeaconHint, int], bytes], Decoder]] = [
    (json.encode, json.decode),
    (cdr.encode, cdr.decode),
    (lambda hint, stamp_ns: cdr.encode(hint, stamp_ns, big_endian=True), cdr.decode),
]
formats = pytest.mark.parametrize(
    ("encode", "decode"), ENCODERS, ids=["json", "cdr-little", "cdr-big"]
)
decoders = pytest.mark.parametrize("decode", [json.decode, cdr.decode], ids=["json", "cdr"])

MAYBE_SURROGATE = st.characters(exclude_categories=())

# Small enough to be cut at every byte.
small_hints = st.builds(
    BeaconHint,
    entity_id=ids(8),
    display_name=st.text(max_size=8),
    function_ids=st.lists(ids(8), max_size=3).map(tuple),
    process_id=st.integers(0, 2**32 - 1),
    metadata=st.dictionaries(ids(8), st.text(max_size=8), max_size=3),
)


def as_text(hint: BeaconHint) -> list[str]:
    """All text of a hint."""
    texts = [value for value in attrs.astuple(hint, recurse=False) if isinstance(value, str)]
    return [
        *texts,
        *hint.function_ids,
        *hint.depends_on,
        *hint.metadata,
        *hint.metadata.values(),
    ]


def check_result(result: Announcement | Malformed) -> None:
    """What holds of anything that comes out of a decoder."""
    if isinstance(result, Malformed):
        assert result.reason.startswith("$")
        assert result.reason.isprintable()
        return
    for text in as_text(result.hint):
        assert type(text) is str
        text.encode()
    assert type(result.hint.process_id) is int
    assert 0 <= result.hint.process_id < 2**32
    assert 0 <= result.stamp_ns < 2**63
    assert len(result.repairs) <= MAX_REPAIRS
    for repair in result.repairs:
        assert repair.startswith(("$.", "... and "))
        assert repair.isprintable()


@formats
@OFTEN
@given(hint=hints(), stamp_ns=stamps())
def test_what_is_written_is_read_back(
    encode: Callable[[BeaconHint, int], bytes], decode: Decoder, hint: BeaconHint, stamp_ns: int
) -> None:
    payload = encode(hint, stamp_ns)
    assert decode(payload) == Announcement(hint, stamp_ns)
    assert encode(hint, stamp_ns) == payload


@formats
@OFTEN
@given(hint=raw_hints())
def test_even_a_careless_hint_is_read_back_as_far_as_it_is_text(
    encode: Callable[[BeaconHint, int], bytes], decode: Decoder, hint: BeaconHint
) -> None:
    result = decode(encode(hint, 0))
    assert isinstance(result, Announcement)
    assert result.repairs == ()
    assert decode(encode(result.hint, 0)) == result


@OFTEN
@given(raw_hints() | hints(), stamps())
def test_all_formats_agree(hint: BeaconHint, stamp_ns: int) -> None:
    one, two, three = (decode(encode(hint, stamp_ns)) for encode, decode in ENCODERS)
    assert one == two == three


@decoders
@OFTEN
@given(payload=hostile_payloads())
def test_any_bytes_give_an_announcement_or_a_reason(decode: Decoder, payload: bytes) -> None:
    check_result(decode(payload))
    assert decode(payload) == decode(payload)


@decoders
@OFTEN
@given(payload=hostile_payloads())
def test_what_was_repaired_once_needs_no_repair_again(decode: Decoder, payload: bytes) -> None:
    result = decode(payload)
    if isinstance(result, Announcement):
        again = json.decode(json.encode(result.hint, result.stamp_ns))
        assert again == Announcement(result.hint, result.stamp_ns)


@OFTEN
@given(payload=hostile_payloads())
def test_the_quick_road_gives_what_the_careful_one_does(payload: bytes) -> None:
    assert json.decode(payload) == json._decode_with_care(payload)
    assert cdr.decode(payload) == cdr_with_care(payload)


@formats
@SELDOM
@given(hint=small_hints, stamp_ns=stamps())
@example(hint=BENCH_HINT, stamp_ns=1_767_225_600_123_456_789)
def test_a_payload_cut_at_any_byte_is_malformed(
    encode: Callable[[BeaconHint, int], bytes], decode: Decoder, hint: BeaconHint, stamp_ns: int
) -> None:
    payload = encode(hint, stamp_ns)
    for size in range(len(payload)):
        result = decode(payload[:size])
        assert isinstance(result, Malformed)
        check_result(result)


@formats
@OFTEN
@given(hint=hints(), flips=st.lists(st.tuples(st.integers(0), st.integers(1, 255)), max_size=4))
def test_flipped_bits_give_an_announcement_or_a_reason(
    encode: Callable[[BeaconHint, int], bytes],
    decode: Decoder,
    hint: BeaconHint,
    flips: list[tuple[int, int]],
) -> None:
    payload = bytearray(encode(hint, 1))
    for at, mask in flips:
        payload[at % len(payload)] ^= mask
    check_result(decode(bytes(payload)))


@formats
@SELDOM
@given(value=st.integers(0, 255))
def test_any_single_byte_may_be_wrong(
    encode: Callable[[BeaconHint, int], bytes], decode: Decoder, value: int
) -> None:
    payload = encode(BENCH_HINT, 1_767_225_600_123_456_789)
    for at in range(len(payload)):
        check_result(decode(payload[:at] + bytes([value]) + payload[at + 1 :]))


@OFTEN
@given(hints(), stamps())
def test_either_byte_order_means_the_same(hint: BeaconHint, stamp_ns: int) -> None:
    little, big = cdr.encode(hint, stamp_ns), cdr.encode(hint, stamp_ns, big_endian=True)
    assert len(little) == len(big)
    assert cdr.decode(little) == cdr.decode(big) == Announcement(hint, stamp_ns)


@OFTEN
@given(hint=hints(), garbage=st.binary(min_size=8), big_endian=st.booleans())
def test_padding_and_options_and_what_follows_do_not_matter(
    hint: BeaconHint, garbage: bytes, *, big_endian: bool
) -> None:
    payload = bytearray(cdr.encode(hint, 1, big_endian=big_endian))
    holes = [2, 3, *padding(payload, "big" if big_endian else "little")]
    for number, at in enumerate(holes):
        payload[at] = garbage[number % len(garbage)]
    assert cdr.decode(bytes(payload) + garbage) == Announcement(hint, 1)


@OFTEN
@given(st.lists(st.text(MAYBE_SURROGATE, max_size=4), max_size=4), st.sampled_from([None, 1]))
def test_escapes_in_json_give_the_text_with_lone_surrogates_replaced(
    texts: list[str], indent: int | None
) -> None:
    fields = {"entity_id": "e", "depends_on": texts}
    payload = std_json.dumps(fields, indent=indent).encode()
    result = json.decode(payload)
    assert isinstance(result, Announcement)
    # A high and a low surrogate side by side are one character once escaped.
    joined = [text.encode("utf-16-le", "surrogatepass") for text in texts]
    wanted = [text.decode("utf-16-le", "surrogatepass") for text in joined]
    assert list(result.hint.depends_on) == [
        "".join("\ufffd" if "\ud800" <= char <= "\udfff" else char for char in text)
        for text in wanted
    ]
    assert len(result.repairs) == sum(
        text != mended for text, mended in zip(wanted, result.hint.depends_on, strict=True)
    )


@decoders
@OFTEN
@given(data=st.binary(max_size=40))
def test_text_that_is_not_utf8_reads_as_python_replaces_it(decode: Decoder, data: bytes) -> None:
    data = data.translate(None, bytes(range(0x20)) + b'"\\')
    template = BeaconHint("e", hostname="#" * len(data))
    encode = json.encode if decode is json.decode else cdr.encode
    result = decode(encode(template).replace(b"#" * len(data), data) if data else encode(template))
    assert isinstance(result, Announcement)
    assert result.hint.hostname == data.decode(errors="replace")
    assert bool(result.repairs) == (data.decode(errors="ignore").encode() != data)


def cdr_with_care(payload: bytes) -> Announcement | Malformed:
    try:
        return cdr._Reader(payload).announcement()
    except cdr._RefusedError as refused:
        return Malformed(str(refused))


def padding(payload: bytearray, order: str) -> list[int]:
    """Where the padding bytes are, found without any of the decoder's code."""
    holes: list[int] = []
    at = 4

    def number() -> int:
        nonlocal at
        at += 4
        word = payload[at - 4 : at]
        return int.from_bytes(word if order == "big" else word[::-1])

    def strings(count: int) -> None:
        nonlocal at
        for _ in range(count):
            length = number()
            end = at + length
            at = (end + 3) // 4 * 4
            holes.extend(range(end, at))

    strings(3)
    strings(number())
    strings(number())
    strings(3)
    number()
    strings(2)
    strings(2 * number())
    return holes
