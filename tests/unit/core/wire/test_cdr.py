"""What is promised of the CDR wire format."""

from __future__ import annotations

import json
import re
import struct
import time
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.errors import UsageError
from beacon_core.hint import NO_METADATA, Announcement, BeaconHint
from beacon_core.limits import MAX_REPAIRS
from beacon_core.ports.adapter import Malformed
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.wire import cdr

FRAMES = Path(__file__).parents[3] / "data" / "cdr"
ENTRIES: list[dict[str, Any]] = [
    json.loads(line) for line in (FRAMES / "hints.jsonl").read_text("utf-8").splitlines()
]
LITTLE, BIG = b"\0\1\0\0", b"\0\0\0\0"
FFFD = "\ufffd"
LAST_STAMP = 2**31 * 10**9 - 1


def word(number: int) -> bytes:
    return struct.pack("<I", number)


def text(data: bytes, padding: bytes = b"\xa5") -> bytes:
    data += b"\0"
    return word(len(data)) + data + padding * (-len(data) % 4)


EMPTY = text(b"")
NO_TIME = word(0) * 2


def frame(**parts: bytes) -> bytes:
    """A little-endian message about ``e`` of which some parts are given as bytes."""
    fields = dict.fromkeys(BeaconHint.__match_args__, EMPTY) | {"entity_id": text(b"e")}
    fields |= dict.fromkeys(("function_ids", "depends_on", "process_id", "metadata"), word(0))
    return LITTLE + b"".join((fields | {"stamp": NO_TIME} | parts).values())


def decoded(payload: bytes) -> Announcement:
    result = cdr.decode(payload)
    assert isinstance(result, Announcement), result
    return result


def reason(payload: bytes) -> str:
    result = cdr.decode(payload)
    assert isinstance(result, Malformed), result
    return result.reason


def hint_of(entry: dict[str, Any]) -> BeaconHint:
    fields = dict(entry["hint"])
    for name in ("function_ids", "depends_on"):
        fields[name] = tuple(fields.get(name, ()))
    return BeaconHint(**fields)


# --- against another implementation


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["name"])
def test_frames_of_another_implementation_are_read(entry: dict[str, Any], order: str) -> None:
    announcement = decoded((FRAMES / f"{entry['name']}.{order}.bin").read_bytes())
    assert announcement.hint == hint_of(entry)
    sec, nanosec = entry["stamp"]["sec"], entry["stamp"]["nanosec"]
    if sec >= 0 and nanosec < 10**9:
        assert announcement.stamp_ns == sec * 10**9 + nanosec
        assert announcement.repairs == ()
    else:
        assert announcement.stamp_ns == 0
        assert announcement.repairs == (
            f"$.stamp: sec {sec}, nanosec {nanosec} is no time, cleared",
        )


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize(
    "entry",
    [entry for entry in ENTRIES if "stamp" not in entry["name"]],
    ids=lambda entry: entry["name"],
)
def test_frames_are_written_as_another_implementation_does(
    entry: dict[str, Any], order: str
) -> None:
    stamp_ns = entry["stamp"]["sec"] * 10**9 + entry["stamp"]["nanosec"]
    payload = cdr.encode(hint_of(entry), stamp_ns, big_endian=order == "big")
    assert payload == (FRAMES / f"{entry['name']}.{order}.bin").read_bytes()


# --- encode


def test_little_endian_is_the_default() -> None:
    assert cdr.encode(BENCH_HINT)[:4] == LITTLE
    assert cdr.encode(BENCH_HINT, big_endian=True)[:4] == BIG


def test_a_lone_surrogate_is_written_as_the_replacement_character() -> None:
    payload = cdr.encode(BeaconHint("e", hostname="a\udc80"))
    assert decoded(payload) == Announcement(BeaconHint("e", hostname=f"a{FFFD}"))


@pytest.mark.parametrize("process_id", [-1, 2**32])
def test_a_process_id_that_cannot_be_written_is_the_callers_mistake(process_id: int) -> None:
    with pytest.raises(UsageError, match=f"process_id={process_id}"):
        cdr.encode(BeaconHint("e", process_id=process_id))


@pytest.mark.parametrize("stamp_ns", [-1, LAST_STAMP + 1])
def test_a_stamp_that_cannot_be_written_is_the_callers_mistake(stamp_ns: int) -> None:
    with pytest.raises(UsageError, match=f"stamp_ns={stamp_ns}: .* 0..{LAST_STAMP}"):
        cdr.encode(BeaconHint("e"), stamp_ns)


# --- what decode tolerates


def test_what_is_not_given_is_empty() -> None:
    assert decoded(frame()) == Announcement(BeaconHint("e"))
    assert decoded(frame()).hint.metadata is NO_METADATA


@pytest.mark.parametrize("options", [b"\0\0", b"\0\3", b"\xff\xff"])
def test_the_options_of_the_header_are_ignored(options: bytes) -> None:
    for order in (LITTLE, BIG):
        payload = cdr.encode(BENCH_HINT, 5, big_endian=order == BIG)
        assert decoded(payload[:2] + options + payload[4:]) == Announcement(BENCH_HINT, 5)


@pytest.mark.parametrize("extra", range(1, 10))
def test_bytes_after_the_message_are_ignored(extra: int) -> None:
    for big_endian in (False, True):
        payload = cdr.encode(BENCH_HINT, 5, big_endian=big_endian)
        assert decoded(payload + b"\xff" * extra) == Announcement(BENCH_HINT, 5)


def test_a_string_of_length_zero_is_empty() -> None:
    payload = frame(stable_id=word(0), depends_on=word(2) + word(0) + text(b"a"), hostname=word(0))
    assert decoded(payload) == Announcement(BeaconHint("e", depends_on=("", "a")))


@pytest.mark.parametrize("data", [b"a", b"ab", b"abc", b"abcd"])
def test_a_string_without_its_nul_is_taken_whole(data: bytes) -> None:
    bare = word(len(data)) + data + b"\xa5" * (-len(data) % 4)
    hint = BeaconHint("e", stable_id=data.decode(), hostname=data.decode())
    assert decoded(frame(stable_id=bare, hostname=bare)) == Announcement(hint)


def test_a_nul_within_a_string_is_part_of_it() -> None:
    assert decoded(frame(hostname=text(b"a\0b\0"))).hint.hostname == "a\0b\0"


def test_of_a_repeated_metadata_key_the_last_one_counts() -> None:
    pairs = text(b"k") + text(b"1") + text(b"k") + text(b"2")
    assert decoded(frame(metadata=word(2) + pairs)).hint.metadata == {"k": "2"}


# --- what decode repairs


def test_text_that_is_not_utf8_is_replaced_and_its_places_reported() -> None:
    payload = frame(
        entity_id=text(b"e\xff"),
        function_ids=word(2) + text(b"f") + text(b"\x80"),
        hostname=text(b"a\xe6\xb8b"),
        process_name=text("é\U0001f321".encode()),
        metadata=word(2) + text(b"k") + text(b"\xc0") + text(b"\xed\xa0\x80") + text(b"v"),
    )
    hint = BeaconHint(
        f"e{FFFD}",
        function_ids=("f", FFFD),
        process_name="é🌡",
        hostname=f"a{FFFD}b",
        metadata={"k": FFFD, FFFD * 3: "v"},
    )
    assert decoded(payload) == Announcement(
        hint,
        0,
        (
            "$.entity_id: not UTF-8, replaced",
            "$.function_ids[1]: not UTF-8, replaced",
            "$.hostname: not UTF-8, replaced",
            "$.metadata.k: not UTF-8, replaced",
            "$.metadata['\\ufffd\\ufffd\\ufffd']: key not UTF-8, replaced",
        ),
    )


def test_repairs_are_capped_and_the_last_one_says_how_many_more() -> None:
    repairs = decoded(frame(depends_on=word(100) + text(b"\xff") * 100)).repairs
    assert len(repairs) == MAX_REPAIRS
    assert repairs[-1] == "... and 69 more"


@pytest.mark.parametrize(
    ("sec", "nanosec"), [(-1, 0), (-(2**31), 999_999_999), (5, 10**9), (0, 2**32 - 1)]
)
def test_a_time_that_is_none_is_cleared_and_reported(sec: int, nanosec: int) -> None:
    assert decoded(frame(stamp=struct.pack("<iI", sec, nanosec))) == Announcement(
        BeaconHint("e"), 0, (f"$.stamp: sec {sec}, nanosec {nanosec} is no time, cleared",)
    )


def test_the_last_stamp_is_one() -> None:
    payload = frame(stamp=struct.pack("<iI", 2**31 - 1, 999_999_999))
    assert decoded(payload) == Announcement(BeaconHint("e"), LAST_STAMP)
    odd = decoded(frame(stamp=payload[-8:], hostname=text(b"\xff")))
    assert odd.stamp_ns == LAST_STAMP


# --- what decode refuses


@pytest.mark.parametrize("size", range(4))
def test_less_than_a_header_is_refused(size: int) -> None:
    assert reason(LITTLE[:size]) == f"$: {size} bytes, too short for a header"


@pytest.mark.parametrize("kind", [2, 3, 6, 7, 10, 0x100, 0xFFFF])
def test_a_header_of_another_encoding_is_refused(kind: int) -> None:
    payload = kind.to_bytes(2, "big") + cdr.encode(BENCH_HINT)[2:]
    assert reason(payload) == f"$: header {kind:04x}0000 is not that of plain CDR"


def test_a_message_that_ends_anywhere_is_refused_with_the_place() -> None:
    for big_endian in (False, True):
        payload = cdr.encode(BENCH_HINT, 5, big_endian=big_endian)
        places = [reason(payload[:size]).split(":")[0] for size in range(4, len(payload))]
        assert list(dict.fromkeys(places)) == [
            "$.entity_id",
            "$.stable_id",
            "$.display_name",
            "$.function_ids",
            "$.function_ids[0]",
            "$.function_ids[1]",
            "$.depends_on",
            "$.depends_on[0]",
            "$.depends_on[1]",
            "$.component_id",
            "$.transport_type",
            "$.negotiated_format",
            "$.process_id",
            "$.process_name",
            "$.hostname",
            "$.metadata",
            "$.metadata.firmware",
            "$.metadata[1]",
            "$.metadata.vendor",
            "$.stamp",
        ]


def test_a_reason_tells_what_was_missing() -> None:
    assert reason(LITTLE) == "$.entity_id: 4 bytes expected, 0 left"
    assert reason(LITTLE + b"\1\0\0") == "$.entity_id: 4 bytes expected, 3 left"
    assert reason(LITTLE + word(9) + b"abc") == "$.entity_id: 9 bytes of text, 3 left"
    assert reason(LITTLE + word(2) + b"a\0") == "$.stable_id: 4 bytes expected, 0 left"


@pytest.mark.parametrize("count", [2**32 - 1, 2**31 - 1, 2**28, 60_000, 40_000])
@pytest.mark.parametrize("field", ["function_ids", "depends_on", "metadata"])
def test_an_absurd_count_is_refused_at_once(field: str, count: int) -> None:
    # What follows would do as entries for long, so that nothing but the count is wrong.
    payload = frame(**{field: word(count) + b"\0" * 150_000})
    took = []
    for _ in range(20):
        begin = time.perf_counter()
        why = reason(payload)
        took.append(time.perf_counter() - begin)
        assert why.startswith(f"$.{field}: {count} entries, ")
    # It takes 10 us, 120 us while coverage is measured; walking the entries takes 7 ms.
    assert min(took) < 1e-3


@pytest.mark.parametrize("length", [2**32 - 1, 2**31, 10_000])
def test_an_absurd_length_is_refused(length: int) -> None:
    assert reason(frame(hostname=word(length))).startswith(f"$.hostname: {length} bytes of text, ")
    assert reason(frame(depends_on=word(1) + word(length))).startswith("$.depends_on[0]: ")


def test_a_count_that_swallows_what_follows_is_refused() -> None:
    assert reason(frame(function_ids=word(9))) == "$.component_id: 4 bytes expected, 0 left"


def test_both_byte_orders_mean_the_same() -> None:
    for hint in (BENCH_HINT, attrs.evolve(BENCH_HINT, display_name="é", metadata={})):
        both = [cdr.encode(hint, 5, big_endian=order) for order in (False, True)]
        assert [decoded(payload) for payload in both] == [Announcement(hint, 5)] * 2


# --- the example of the documentation


def test_the_documented_bytes_are_those_that_are_written_and_read() -> None:
    docs = (Path(__file__).parents[4] / "docs" / "wire-formats.md").read_text("utf-8")
    section = docs.partition("## CDR")[2]
    rows = re.findall(r"^((?:[0-9a-f]{2} )+)  ", section, re.MULTILINE)
    payload = bytes.fromhex("".join(rows))
    announcement = decoded(payload)
    assert announcement.hint.display_name == "Öl"
    assert announcement.hint.metadata == {"vendor": "acme"}
    assert cdr.encode(announcement.hint, announcement.stamp_ns) == payload
