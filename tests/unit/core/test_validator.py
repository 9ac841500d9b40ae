"""The validator: the C++ system's results where we agree, each difference by name, and ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.errors import UsageError
from beacon_core.hint import NO_METADATA, BeaconHint
from beacon_core.limits import DEFAULT_LIMITS, MAX_LOG_CHARS, MAX_REPAIRS, HintLimits, hint_bytes
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.validator import (
    Accepted,
    Rejected,
    clean_size,
    is_valid_id,
    require_id,
    validate,
)

VECTORS = Path(__file__).parents[2] / "data" / "vectors" / "validator.jsonl"
CASES = [json.loads(line) for line in VECTORS.read_text(encoding="utf-8").splitlines()]
FREE_STRINGS = ["display_name", "transport_type", "negotiated_format", "process_name", "hostname"]
NOT_IDS = [
    "a b",
    "a/b",
    "a.b",
    "node\n",
    "\nnode",
    "a\nb",
    "n\x00",
    "n\u0661",  # Arabic-Indic one: a digit, but not of ASCII
    "n\u00b2",  # superscript two
    "straße",
    "\ufeffnode",
    "n\udc80",
    "x" * 257,
]


def bench_hint_with(**fields: Any) -> BeaconHint:
    return attrs.evolve(BENCH_HINT, **fields)


# -- the C++ system's cases ----------------------------------------------------------------------


def cases(*flags: str, valid: bool) -> pytest.MarkDecorator:
    chosen = [c for c in CASES if c["valid"] == valid and all(flag in c for flag in flags)]
    assert chosen
    return pytest.mark.parametrize("case", [pytest.param(c, id=f"{c['n']}") for c in chosen])


@cases(valid=False)
def test_what_the_cpp_system_rejects_is_rejected(case: dict[str, Any]) -> None:
    assert isinstance(validate(vector_hint(case["in"]), vector_limits(case)), Rejected)


@cases(valid=True)
def test_what_the_cpp_system_accepts_comes_out_the_same(case: dict[str, Any]) -> None:
    hint, limits = vector_hint(case["in"]), vector_limits(case)
    given = accepted(hint, limits)
    # Difference "utf8_split": there the byte cut goes through a character, here it goes before it.
    # Difference "input_invalid_utf8": there such bytes stay, here U+FFFD stands for them.
    expected = vector_hint(case["out_char_boundary"] if "utf8_split" in case else case["out"])
    if "order_dependent" in case:
        # Difference: there metadata is cut to its cap in hash order, and bad keys are dropped
        # after that. Here bad keys go first, and the order is that of arrival.
        expected = attrs.evolve(expected, metadata=first_good_entries(hint, limits))
    assert given.hint == expected
    assert (given.hint is hint) == (given.repairs == ()) == (given.hint == hint)


@cases("order_dependent", valid=True)
def test_metadata_over_its_cap_is_within_what_the_cpp_system_may_keep(
    case: dict[str, Any],
) -> None:
    hint, limits = vector_hint(case["in"]), vector_limits(case)
    kept, cap = accepted(hint, limits).hint.metadata, limits.max_metadata_entries
    good = [key for key in hint.metadata if is_key(key, limits)]
    assert max(0, cap - (len(hint.metadata) - len(good))) <= len(kept) <= min(cap, len(good))
    assert all(hint.metadata[key].startswith(kept[key]) for key in kept)


@pytest.mark.parametrize("errors", ["replace", "surrogateescape"])
@cases("input_invalid_utf8", valid=True)
def test_bytes_that_are_not_utf8_end_the_same_however_a_carrier_decoded_them(
    case: dict[str, Any], errors: str
) -> None:
    # A decoder may put U+FFFD for them, as ours do, or surrogates, as Python does for names from
    # the operating system.
    assert accepted(vector_hint(case["in"], errors)).hint == vector_hint(case["out"])


def vector_hint(fields: dict[str, Any], errors: str = "replace") -> BeaconHint:
    def text(value: Any) -> Any:
        return bytes.fromhex(value["$hex"]).decode(errors=errors) if is_hex(value) else value

    def is_hex(value: Any) -> bool:
        return isinstance(value, dict) and "$hex" in value

    values: dict[str, Any] = {
        name: tuple(map(text, value)) if isinstance(value, list) else text(value)
        for name, value in fields.items()
        if name != "metadata"
    }
    metadata = fields.get("metadata", {})
    # A list of pairs where a key is not UTF-8.
    pairs = metadata.items() if isinstance(metadata, dict) else metadata
    return BeaconHint(**values, metadata={text(key): text(value) for key, value in pairs})


def vector_limits(case: dict[str, Any]) -> HintLimits:
    return HintLimits(**case.get("limits", {}))


def first_good_entries(hint: BeaconHint, limits: HintLimits) -> dict[str, str]:
    good = [key for key in hint.metadata if is_key(key, limits)]
    return {
        key: cut(hint.metadata[key], limits.max_metadata_value_length)
        for key in good[: limits.max_metadata_entries]
    }


def is_key(text: str, limits: HintLimits) -> bool:
    return is_valid_id(text) and len(text) <= limits.max_metadata_key_length


def cut(text: str, limit: int) -> str:
    while len(text.encode()) > limit:
        text = text[:-1]
    return text


# -- ids -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["x", "0", "_", "-", "Node_7-b", "x" * 256])
def test_ids_are_1_to_256_of_ascii_letters_digits_underscore_and_hyphen(text: str) -> None:
    assert is_valid_id(text)
    assert validate(BeaconHint(text)) == Accepted(BeaconHint(text), ())


@pytest.mark.parametrize("text", ["", *NOT_IDS])
def test_nothing_else_is_an_id(text: str) -> None:
    assert not is_valid_id(text)
    assert isinstance(validate(BeaconHint(text)), Rejected)


@pytest.mark.parametrize("text", ["x", "x" * 256])
def test_what_is_an_id_may_be_asked_for(text: str) -> None:
    require_id(text, "announce: ")


@pytest.mark.parametrize("text", ["", *NOT_IDS])
def test_asking_for_what_is_no_id_is_the_callers_mistake(text: str) -> None:
    with pytest.raises(UsageError) as refused:
        require_id(text, "announce: ")
    assert str(refused.value) == (
        f"announce: entity_id {text!r} is no id; write 1 to 256 letters, digits, '_' or '-'"
    )


def test_the_alphabet_is_exact() -> None:
    allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    assert {chr(n) for n in range(0x11000) if is_valid_id(chr(n))} == set(allowed)


def test_a_rejection_names_the_place_shows_the_text_and_says_what_is_right() -> None:
    assert validate(BeaconHint("a\nb")) == Rejected(
        r"$.entity_id: 'a\nb' is not an id (1..256 of A-Z a-z 0-9 _ -)"
    )


def test_a_rejection_is_short_however_long_the_id() -> None:
    verdict = validate(BeaconHint("\x1b" * 10**6))
    assert isinstance(verdict, Rejected)
    assert len(verdict.reason) < MAX_LOG_CHARS + 80


def test_a_bad_entity_id_rejects_whatever_else_is_wrong() -> None:
    hint = BeaconHint("a b", stable_id="a b", hostname="x" * 600, metadata={"a b": ""})
    assert isinstance(validate(hint), Rejected)


@pytest.mark.parametrize("text", NOT_IDS)
@pytest.mark.parametrize("field", ["stable_id", "component_id"])
def test_a_bad_stable_or_component_id_is_cleared(field: str, text: str) -> None:
    hint = bench_hint_with(**{field: text})
    given = accepted(hint)
    assert given.hint == bench_hint_with(**{field: ""})
    assert given.repairs == (f"$.{field}: not an id, cleared",)


# -- the two lists -------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["", *NOT_IDS])
@pytest.mark.parametrize("field", ["function_ids", "depends_on"])
def test_a_bad_id_in_a_list_is_dropped_and_its_index_told(field: str, text: str) -> None:
    given = accepted(bench_hint_with(**{field: ("a", "b", "c", text, "d")}))
    assert given.hint == bench_hint_with(**{field: ("a", "b", "c", "d")})
    assert given.repairs == (f"$.{field}[3]: not an id, dropped",)


@pytest.mark.parametrize("field", ["function_ids", "depends_on"])
def test_a_list_at_its_cap_is_whole(field: str) -> None:
    hint = bench_hint_with(**{field: numbered(100)})
    assert accepted(hint).hint is hint


@pytest.mark.parametrize("field", ["function_ids", "depends_on"])
def test_a_list_over_its_cap_keeps_the_first(field: str) -> None:
    given = accepted(bench_hint_with(**{field: numbered(120)}))
    assert given.hint == bench_hint_with(**{field: numbered(100)})
    assert given.repairs == (f"$.{field}: 120 entries, kept the first 100",)


@pytest.mark.parametrize("field", ["function_ids", "depends_on"])
def test_bad_ids_are_dropped_before_a_list_is_capped(field: str) -> None:
    given = accepted(bench_hint_with(**{field: ("a b", *numbered(101))}))
    assert given.hint == bench_hint_with(**{field: numbered(100)})
    assert given.repairs == (
        f"$.{field}[0]: not an id, dropped",
        f"$.{field}: 101 entries, kept the first 100",
    )


def test_doubles_and_the_own_id_in_a_list_are_kept() -> None:
    hint = BeaconHint("a", function_ids=("f", "f", "F"), depends_on=("a", "a"))
    assert accepted(hint).hint is hint


# -- free strings and metadata values ------------------------------------------------------------


@pytest.mark.parametrize("field", FREE_STRINGS)
def test_a_free_string_has_up_to_512_bytes(field: str) -> None:
    hint = bench_hint_with(**{field: "x" * 512})
    assert accepted(hint).hint is hint
    given = accepted(bench_hint_with(**{field: "x" * 600}))
    assert given.hint == hint
    assert given.repairs == (f"$.{field}: truncated 600 -> 512 bytes",)


def test_a_metadata_value_has_up_to_1024_bytes() -> None:
    hint = bench_hint_with(metadata={"a": "x", "foo": "x" * 1024})
    assert accepted(hint).hint is hint
    given = accepted(bench_hint_with(metadata={"a": "x", "foo": "x" * 2048}))
    assert given.hint == hint
    assert given.repairs == ("$.metadata.foo: truncated 2048 -> 1024 bytes",)


@pytest.mark.parametrize("char", ["é", "日", "\N{GRINNING FACE}"])
@pytest.mark.parametrize("lead", range(4))
def test_a_cut_never_splits_a_character(char: str, lead: int) -> None:
    text = "x" * lead + char * 512
    given = accepted(BeaconHint("a", hostname=text, metadata={"k": text * 2}))
    for kept, limit in ((given.hint.hostname, 512), (given.hint.metadata["k"], 1024)):
        assert text.startswith(kept[:512])
        assert limit - len(char.encode()) < len(kept.encode()) <= limit
    size, left = len(text.encode()), len(given.hint.hostname.encode())
    assert given.repairs[0] == f"$.hostname: truncated {size} -> {left} bytes"


def test_a_string_within_its_limit_in_characters_but_not_in_bytes_is_cut() -> None:
    assert accepted(BeaconHint("a", hostname="é" * 300)).hint.hostname == "é" * 256


def test_a_character_that_ends_at_the_limit_is_kept() -> None:
    hint = BeaconHint("a", hostname="x" * 508 + "\N{GRINNING FACE}", process_name="é")
    assert accepted(hint).hint is hint


def test_in_a_hint_with_other_faults_text_that_just_fits_is_no_fault() -> None:
    hint = BeaconHint("a", stable_id="a b", hostname="é" * 256, metadata={"k": "é" * 512})
    given = accepted(hint)
    assert given.hint == attrs.evolve(hint, stable_id="")
    assert given.repairs == ("$.stable_id: not an id, cleared",)


def test_what_is_not_utf8_is_repaired_and_reported() -> None:
    given = accepted(BeaconHint("a", hostname="r\udcffb\ud83d\ude00", metadata={"k": "\ud800"}))
    assert given.hint == BeaconHint("a", hostname="r\ufffdb\ufffd\ufffd", metadata={"k": "\ufffd"})
    assert given.repairs == (
        "$.hostname: not UTF-8, repaired with U+FFFD",
        "$.metadata.k: not UTF-8, repaired with U+FFFD",
    )


def test_repair_comes_before_the_cut_so_that_nothing_is_too_long_after() -> None:
    given = accepted(BeaconHint("a", hostname="\udcff" * 200))
    assert given.hint.hostname == "\ufffd" * 170
    assert given.repairs == (
        "$.hostname: not UTF-8, repaired with U+FFFD",
        "$.hostname: truncated 600 -> 510 bytes",
    )


def test_two_halves_of_a_pair_in_two_fields_do_not_pass_as_one_character() -> None:
    given = accepted(BeaconHint("a", display_name="\ud83d", transport_type="\ude00"))
    assert (given.hint.display_name, given.hint.transport_type) == ("\ufffd", "\ufffd")


def test_controls_in_free_text_are_kept() -> None:
    hint = BeaconHint("a", display_name="a\nb\x00\x1b[0m\u202e", metadata={"k": "\t"})
    assert accepted(hint).hint is hint


# -- metadata keys -------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["", *NOT_IDS, "k" * 65])
def test_metadata_with_a_bad_key_is_dropped(key: str) -> None:
    given = accepted(BeaconHint("a", metadata={"k": "1", key: "2", "l": "3"}))
    assert given.hint == BeaconHint("a", metadata={"k": "1", "l": "3"})
    (repair,) = given.repairs
    assert repair.startswith("$.metadata")
    assert repair.endswith(": not a key, dropped")
    assert len(repair) < MAX_LOG_CHARS + 40
    assert repair.isprintable()
    assert repair.isascii()


def test_metadata_with_50_long_keys_is_kept() -> None:
    hint = BeaconHint("a", metadata={f"{n:064}": "" for n in range(50)})
    assert accepted(hint).hint is hint


def test_metadata_over_its_cap_keeps_what_came_first() -> None:
    metadata = {f"k{n}": "v" for n in range(99, 0, -1)}
    given = accepted(BeaconHint("a", metadata=metadata))
    assert list(given.hint.metadata) == list(metadata)[:50]
    assert given.repairs == ("$.metadata: 99 entries, kept the first 50",)


def test_bad_keys_are_dropped_before_metadata_is_capped() -> None:
    good = {f"k{n}": "v" for n in range(50)}
    given = accepted(BeaconHint("a", metadata={f"bad {n}": "v" for n in range(20)} | good))
    assert given.hint == BeaconHint("a", metadata=good)
    assert len(given.repairs) == 20


def test_values_of_dropped_metadata_are_not_reported() -> None:
    metadata = {f"k{n}": "v" for n in range(50)} | {"late": "x" * 2000}
    given = accepted(BeaconHint("a", metadata=metadata))
    assert given.repairs == ("$.metadata: 51 entries, kept the first 50",)


# -- the process id ------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [0, 1, 2**32 - 1])
def test_a_process_id_is_an_unsigned_number_of_32_bits(number: int) -> None:
    hint = BeaconHint("a", process_id=number)
    assert accepted(hint).hint is hint


@pytest.mark.parametrize("number", [-1, 2**32, pytest.param(10**5000, id="of 5001 digits")])
def test_any_other_process_id_is_cleared(number: int) -> None:
    given = accepted(BeaconHint("a", process_id=number))
    assert given == Accepted(BeaconHint("a"), ("$.process_id: not in 0..4294967295, cleared",))


# -- the whole -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "hint",
    [
        BENCH_HINT,
        BeaconHint("a"),
        BeaconHint("a", metadata=NO_METADATA),
        bench_hint_with(display_name="Motörtemperatur", hostname="ロボット"),
        bench_hint_with(hostname="ロ" * 170, process_name="x" * 512),
        bench_hint_with(entity_id="x" * 256, stable_id="y" * 256),
    ],
)
def test_a_clean_hint_comes_back_as_the_same_object(hint: BeaconHint) -> None:
    given = validate(hint)
    assert isinstance(given, Accepted)
    assert given.hint is hint
    assert given.repairs == ()


@pytest.mark.parametrize("name", ["", "plain", "Müller", "Zażółć", "a robot \N{ROBOT FACE}"])
def test_what_is_counted_of_a_clean_hint_is_what_weighing_it_would_give(name: str) -> None:
    hint = BeaconHint("e", display_name=name, function_ids=("f",), metadata={"k": name, "l": "v"})
    counted = clean_size(hint, DEFAULT_LIMITS)
    assert counted > 2 * len(name)
    assert hint_bytes(hint, counted) == hint_bytes(hint)


def test_a_hint_at_all_its_limits_comes_back_as_the_same_object() -> None:
    hint = filled(ids=256, texts=512, entries=100, key=64, value=1024, metadata=50)
    assert accepted(hint).hint is hint


def test_a_hint_one_over_each_limit_is_brought_back_to_all_of_them() -> None:
    given = accepted(filled(ids=256, texts=513, entries=101, key=64, value=1025, metadata=51))
    assert given.hint == filled(ids=256, texts=512, entries=100, key=64, value=1024, metadata=50)
    assert accepted(given.hint).hint is given.hint


def test_repairs_come_in_the_order_of_the_fields() -> None:
    hint = BeaconHint(
        entity_id="a",
        stable_id="a b",
        display_name="x" * 513,
        function_ids=("a b",),
        depends_on=("", "b"),
        component_id="a b",
        transport_type="x" * 514,
        negotiated_format="x" * 515,
        process_id=-1,
        process_name="x" * 516,
        hostname="x" * 517,
        metadata={"a b": "", "k": "x" * 1025},
    )
    assert accepted(hint).repairs == (
        "$.stable_id: not an id, cleared",
        "$.display_name: truncated 513 -> 512 bytes",
        "$.function_ids[0]: not an id, dropped",
        "$.depends_on[0]: not an id, dropped",
        "$.component_id: not an id, cleared",
        "$.transport_type: truncated 514 -> 512 bytes",
        "$.negotiated_format: truncated 515 -> 512 bytes",
        "$.process_id: not in 0..4294967295, cleared",
        "$.process_name: truncated 516 -> 512 bytes",
        "$.hostname: truncated 517 -> 512 bytes",
        "$.metadata['a b']: not a key, dropped",
        "$.metadata.k: truncated 1025 -> 1024 bytes",
    )


def test_a_hint_with_ten_thousand_bad_ids_is_reported_in_few_words() -> None:
    repairs = accepted(BeaconHint("a", function_ids=("a b",) * 10_000)).repairs
    assert len(repairs) == MAX_REPAIRS
    assert repairs[-1] == f"... and {10_001 - MAX_REPAIRS} more"


def test_limits_can_be_narrowed() -> None:
    limits = HintLimits(
        max_id_length=3,
        max_string_length=2,
        max_function_ids=1,
        max_depends_on=0,
        max_metadata_entries=1,
        max_metadata_key_length=1,
        max_metadata_value_length=0,
    )
    hint = BeaconHint(
        "abc",
        stable_id="abcd",
        display_name="日",
        function_ids=("abcd", "f", "g"),
        depends_on=("d",),
        metadata={"kk": "v", "k": "v", "l": "v"},
    )
    expected = BeaconHint("abc", function_ids=("f",), metadata={"k": ""})
    assert accepted(hint, limits).hint == expected
    assert isinstance(validate(BeaconHint("abcd"), limits), Rejected)


def test_a_key_may_be_longer_than_an_id_if_the_limits_say_so() -> None:
    hint = BeaconHint("a", metadata={"k" * 20: "v"})
    limits = HintLimits(max_id_length=10)
    assert accepted(hint, limits).hint is hint


def filled(
    *, ids: int, texts: int, entries: int, key: int, value: int, metadata: int
) -> BeaconHint:
    return BeaconHint(
        entity_id="x" * ids,
        stable_id="x" * ids,
        display_name="x" * texts,
        function_ids=tuple(f"{n:0{ids}}" for n in range(entries)),
        depends_on=tuple(f"{n:0{ids}}" for n in range(entries)),
        component_id="x" * ids,
        transport_type="x" * texts,
        negotiated_format="x" * texts,
        process_id=2**32 - 1,
        process_name="x" * texts,
        hostname="x" * texts,
        metadata={f"{n:0{key}}": "x" * value for n in range(metadata)},
    )


def numbered(count: int) -> tuple[str, ...]:
    return tuple(f"id-{number}" for number in range(count))


def accepted(hint: BeaconHint, limits: HintLimits = DEFAULT_LIMITS) -> Accepted:
    verdict = validate(hint, limits)
    assert isinstance(verdict, Accepted)
    return verdict
