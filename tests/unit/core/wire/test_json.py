"""What is promised of the JSON wire format."""

from __future__ import annotations

import json as std_json
import re
from pathlib import Path
from typing import Any

import pytest

from beacon_core.errors import UsageError
from beacon_core.hint import NO_METADATA, Announcement, BeaconHint
from beacon_core.limits import MAX_REPAIRS
from beacon_core.ports.adapter import Malformed
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.wire import json

FFFD = "\ufffd"


def decoded(payload: bytes) -> Announcement:
    result = json.decode(payload)
    assert isinstance(result, Announcement), result
    return result


def decoded_fields(**fields: Any) -> Announcement:
    return decoded(std_json.dumps({"entity_id": "e", **fields}).encode())


def reason(payload: bytes) -> str:
    result = json.decode(payload)
    assert isinstance(result, Malformed), result
    return result.reason


# --- encode


def test_only_given_fields_are_written_and_compactly() -> None:
    assert json.encode(BeaconHint("e")) == b'{"entity_id":"e"}'


def test_every_field_is_written_in_the_order_of_the_message() -> None:
    hint = BeaconHint("e", "s", "d", ("f",), ("g",), "c", "t", "n", 7, "p", "h", {"k": "v"})
    assert json.encode(hint, 1_000_000_002) == (
        b'{"entity_id":"e","stable_id":"s","display_name":"d","function_ids":["f"],'
        b'"depends_on":["g"],"component_id":"c","transport_type":"t","negotiated_format":"n",'
        b'"process_id":7,"process_name":"p","hostname":"h","metadata":{"k":"v"},'
        b'"stamp":{"sec":1,"nanosec":2}}'
    )


def test_the_entity_id_is_written_even_when_it_is_empty() -> None:
    assert json.encode(BeaconHint("")) == b'{"entity_id":""}'


def test_text_is_written_as_utf8_not_as_escapes() -> None:
    assert json.encode(BeaconHint("e", hostname="é")) == '{"entity_id":"e","hostname":"é"}'.encode()


def test_a_lone_surrogate_is_written_as_the_replacement_character() -> None:
    payload = json.encode(BeaconHint("e", hostname="a\udc80"))
    assert decoded(payload) == Announcement(BeaconHint("e", hostname=f"a{FFFD}"))


@pytest.mark.parametrize("process_id", [-1, 2**32])
def test_a_process_id_that_cannot_be_written_is_the_callers_mistake(process_id: int) -> None:
    with pytest.raises(UsageError, match=rf"process_id={process_id}: expected 0\.\.4294967295"):
        json.encode(BeaconHint("e", process_id=process_id))


@pytest.mark.parametrize("stamp_ns", [-1, (json.MAX_STAMP_SEC + 1) * 10**9])
def test_a_stamp_that_cannot_be_written_is_the_callers_mistake(stamp_ns: int) -> None:
    with pytest.raises(UsageError, match=f"stamp_ns={stamp_ns}"):
        json.encode(BeaconHint("e"), stamp_ns)


def test_the_last_stamp_survives_the_round_trip() -> None:
    last = (json.MAX_STAMP_SEC + 1) * 10**9 - 1
    assert last < 2**63
    assert decoded(json.encode(BENCH_HINT, last)) == Announcement(BENCH_HINT, last)


# --- decode what is well formed


def test_the_bench_hint_survives_the_round_trip() -> None:
    payload = json.encode(BENCH_HINT)
    assert 420 <= len(payload) <= 430
    assert decoded(payload) == Announcement(BENCH_HINT)


def test_what_is_left_out_is_empty() -> None:
    assert decoded(b'{"entity_id":"e"}') == Announcement(BeaconHint("e"))
    assert decoded(b'{"entity_id":"e"}').hint.metadata is NO_METADATA


def test_null_is_the_same_as_left_out() -> None:
    names = [*BeaconHint.__match_args__[1:], "stamp"]
    assert decoded_fields(**dict.fromkeys(names)) == Announcement(BeaconHint("e"))
    assert decoded_fields(
        function_ids=[None, "f"], metadata={"k": None}, stamp={"sec": 1, "nanosec": None}
    ) == Announcement(BeaconHint("e", function_ids=("f",)), 10**9)


def test_unknown_fields_are_ignored_whatever_they_hold() -> None:
    assert decoded_fields(new_field={"a": [1, None]}, other=2**70) == Announcement(BeaconHint("e"))


def test_white_space_around_and_within_is_ignored() -> None:
    assert decoded(b'\n { "entity_id" :\t"e" } \r\n') == Announcement(BeaconHint("e"))
    assert decoded(b'{"entity_id":"e"}\n') == Announcement(BeaconHint("e"))


def test_a_byte_order_mark_is_ignored() -> None:
    assert decoded(b'\xef\xbb\xbf{"entity_id":"e"}') == Announcement(BeaconHint("e"))


def test_of_a_repeated_key_the_last_one_counts() -> None:
    payload = b'{"entity_id":"a","entity_id":"b","metadata":{"k":"1","k":"2"}}'
    assert decoded(payload) == Announcement(BeaconHint("b", metadata={"k": "2"}))


def test_escapes_are_undone_without_a_repair() -> None:
    payload = rb'{"entity_id":"e","display_name":"\u00e9 \ud83c\udf21 \"\\ud800\" \u0000"}'
    assert decoded(payload) == Announcement(BeaconHint("e", display_name='é 🌡 "\\ud800" \0'))


def test_a_stamp_may_leave_out_either_half() -> None:
    assert decoded_fields(stamp={"sec": 3}).stamp_ns == 3 * 10**9
    assert decoded_fields(stamp={"nanosec": 5}).stamp_ns == 5
    assert decoded_fields(stamp={}) == Announcement(BeaconHint("e"))


# --- decode what needs a repair


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
@pytest.mark.parametrize(
    ("value", "found"),
    [(1, "1"), (1.5, "1.5"), (False, "boolean"), (["a"], "array"), ({"a": "b"}, "object")],
)
def test_a_string_of_another_type_is_cleared_and_reported(
    field: str, value: object, found: str
) -> None:
    assert decoded_fields(**{field: value}) == Announcement(
        BeaconHint("e"), 0, (f"$.{field}: expected a string, found {found}, cleared",)
    )


@pytest.mark.parametrize("field", ["function_ids", "depends_on"])
@pytest.mark.parametrize(
    ("value", "found"), [("abc", "string"), ({"a": "b"}, "object"), (True, "boolean"), (0, "0")]
)
def test_a_list_of_another_type_is_cleared_and_reported(
    field: str, value: object, found: str
) -> None:
    assert decoded_fields(**{field: value}) == Announcement(
        BeaconHint("e"), 0, (f"$.{field}: expected an array of strings, found {found}, cleared",)
    )


def test_an_entry_of_another_type_is_dropped_and_its_place_reported() -> None:
    assert decoded_fields(depends_on=["a", 1, ["b"], "c"]) == Announcement(
        BeaconHint("e", depends_on=("a", "c")),
        0,
        (
            "$.depends_on[1]: expected a string, found 1, dropped",
            "$.depends_on[2]: expected a string, found array, dropped",
        ),
    )


@pytest.mark.parametrize(
    ("value", "found"),
    [
        ("7", "string"),
        (True, "boolean"),
        (-1, "-1"),
        (2**32, "4294967296"),
        (7.0, "7.0"),
        ([7], "array"),
        (10**200, "a huge number"),
        (-(10**18), "a huge number"),
    ],
)
def test_a_process_id_that_is_none_is_cleared_and_reported(value: object, found: str) -> None:
    assert decoded_fields(process_id=value) == Announcement(
        BeaconHint("e"),
        0,
        (f"$.process_id: expected an integer 0..4294967295, found {found}, cleared",),
    )


def test_a_number_too_large_for_a_float_is_one_of_them() -> None:
    assert decoded(b'{"entity_id":"e","process_id":1e999}').repairs == (
        "$.process_id: expected an integer 0..4294967295, found a huge number, cleared",
    )


@pytest.mark.parametrize("process_id", [0, 1, 2**32 - 1])
def test_the_whole_range_of_process_ids_is_taken(process_id: int) -> None:
    assert decoded_fields(process_id=process_id).hint.process_id == process_id
    assert decoded_fields(process_id=process_id, hostname=0).hint.process_id == process_id


def test_metadata_of_another_type_is_cleared_and_reported() -> None:
    assert decoded_fields(metadata=[["k", "v"]]) == Announcement(
        BeaconHint("e"), 0, ("$.metadata: expected an object of strings, found array, cleared",)
    )


def test_a_metadata_value_of_another_type_is_dropped_and_its_key_shown_escaped() -> None:
    assert decoded_fields(metadata={"k": 1, "l": "v", "a\nb": {}}) == Announcement(
        BeaconHint("e", metadata={"l": "v"}),
        0,
        (
            "$.metadata.k: expected a string, found 1, dropped",
            "$.metadata['a\\nb']: expected a string, found object, dropped",
        ),
    )


@pytest.mark.parametrize(
    "stamp",
    [
        5,
        "now",
        [1, 2],
        {"sec": -1, "nanosec": 0},
        {"sec": 1, "nanosec": -1},
        {"sec": 1, "nanosec": 10**9},
        {"sec": json.MAX_STAMP_SEC + 1},
        {"sec": 10**300},
        {"sec": True},
        {"sec": 1.5},
        {"sec": 1, "nanosec": "0"},
    ],
)
def test_a_stamp_that_is_none_is_cleared_and_reported(stamp: object) -> None:
    assert decoded_fields(stamp=stamp) == Announcement(
        BeaconHint("e"),
        0,
        ('$.stamp: expected {"sec": 0..9223372035, "nanosec": 0..999999999}, cleared',),
    )


def test_text_that_is_not_utf8_is_replaced_and_its_places_reported() -> None:
    payload = (
        b'{"entity_id":"e\xff","hostname":"a\xe6\xb8b","unknown":"\xff","function_ids":["f","\x80"]'
        b',"metadata":{"k":"\xc0","\xfe":"v"}}'
    )
    hint = BeaconHint(
        f"e{FFFD}",
        hostname=f"a{FFFD}b",
        function_ids=("f", FFFD),
        metadata={"k": FFFD, FFFD: "v"},
    )
    assert decoded(payload) == Announcement(
        hint,
        0,
        (
            "$.entity_id: not UTF-8, replaced",
            "$.function_ids[1]: not UTF-8, replaced",
            "$.hostname: not UTF-8, replaced",
            "$.metadata.k: not UTF-8, replaced",
            "$.metadata['\\ufffd']: key not UTF-8, replaced",
        ),
    )


def test_an_honest_replacement_character_is_no_repair() -> None:
    payload = f'{{"entity_id":"e","hostname":"{FFFD}"'.encode()
    assert decoded(payload + b"}") == Announcement(BeaconHint("e", hostname=FFFD))
    assert decoded(payload + b',"stable_id":"\xff"}').repairs == (
        "$.stable_id: not UTF-8, replaced",
    )


@pytest.mark.parametrize(
    ("field", "path"),
    [
        (rb'"hostname":"a\ud800"', "$.hostname"),
        (rb'"hostname":"\udfff\ud800"', "$.hostname"),
        (rb'"depends_on":["\uDBFF"]', "$.depends_on[0]"),
        (rb'"metadata":{"k":"\udc00"}', "$.metadata.k"),
    ],
)
def test_a_lone_surrogate_is_replaced_and_its_place_reported(field: bytes, path: str) -> None:
    announcement = decoded(b'{"entity_id":"e",' + field + b"}")
    assert announcement.repairs == (f"{path}: not UTF-8, replaced",)
    assert "\ufffd" in repr(announcement.hint)
    repr(announcement.hint).encode()


def test_a_lone_surrogate_in_a_key_is_replaced_and_reported() -> None:
    assert decoded(rb'{"entity_id":"e","metadata":{"\ud800":"v"}}') == Announcement(
        BeaconHint("e", metadata={FFFD: "v"}),
        0,
        ("$.metadata['\\ufffd']: key not UTF-8, replaced",),
    )


def test_two_halves_in_two_fields_are_two_lone_surrogates() -> None:
    assert decoded(rb'{"entity_id":"e","process_name":"\ud83c","hostname":"\udf21"}').repairs == (
        "$.process_name: not UTF-8, replaced",
        "$.hostname: not UTF-8, replaced",
    )


def test_repairs_are_capped_and_the_last_one_says_how_many_more() -> None:
    repairs = decoded_fields(depends_on=[0] * 10_000).repairs
    assert len(repairs) == MAX_REPAIRS
    assert repairs[-1] == "... and 9969 more"


# --- refuse what is no hint


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (b"", "$: not JSON: Expecting value at character 0"),
        (b"engine", "$: not JSON: Expecting value at character 0"),
        (b'{"entity_id":"e"} x', "$: not JSON: Extra data at character 18"),
        (b'{"entity_id":"e"}{"entity_id":"f"}', "$: not JSON: Extra data at character 17"),
        (b'{"entity_id":"a\nb"}', "$: not JSON: Invalid control character at at character 15"),
        (b'{"entity_id":"e","x":NaN}', "$: not JSON: NaN is not a number"),
        (b'{"entity_id":"e","x":-Infinity}', "$: not JSON: -Infinity is not a number"),
        (b'{"entity_id":"e",\xff:1}', None),
        ('{"entity_id":"e"}'.encode("utf-16"), None),
        (b'{"entity_id":"e","x":' + b"9" * 5_000 + b"}", "$: a number of thousands of digits"),
        (b"[" * 100_000, "$: nested too deeply"),
        (b'{"entity_id":"e","x":' + b'{"a":' * 100_000, "$: nested too deeply"),
        (b"null", "$: expected an object, found null"),
        (b"true", "$: expected an object, found boolean"),
        (b"12", "$: expected an object, found 12"),
        (b'"e"', "$: expected an object, found string"),
        (b'["entity_id"]', "$: expected an object, found array"),
        (b"{}", "$.entity_id: missing"),
        (b'{"entity_id":null}', "$.entity_id: missing"),
        (b'{"entity_id":7}', "$.entity_id: expected a string, found 7"),
        (b'{"entity_id":["e"]}', "$.entity_id: expected a string, found array"),
    ],
)
def test_what_is_no_hint_is_malformed_with_the_place_and_the_cause(
    payload: bytes, why: str | None
) -> None:
    found = reason(payload)
    assert found.startswith("$: not JSON: ") if why is None else found == why


def test_a_reason_repeats_nothing_of_the_payload() -> None:
    assert "\x1b" not in reason(b'{"entity_id":"\x1b[31m"}')


# --- the example of the documentation


def test_the_documented_bytes_are_those_that_are_written_and_read() -> None:
    text = (Path(__file__).parents[4] / "docs" / "wire-formats.md").read_text("utf-8")
    section = text.partition("## JSON")[2].partition("## CDR")[0]
    example = re.search(r"```json\n(.*)\n```", section)
    assert example is not None
    payload = example[1].encode()
    rows = re.findall(r"^((?:[0-9a-f]{2} )+)  ", section, re.MULTILINE)
    assert bytes.fromhex("".join(rows)) == payload
    announcement = decoded(payload)
    assert announcement.repairs == ()
    assert json.encode(announcement.hint, announcement.stamp_ns) == payload
