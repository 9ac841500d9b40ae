"""Repairs in words: where, what, and never more than a person wants to read."""

from __future__ import annotations

import pytest

from beacon_core.limits import MAX_LOG_CHARS, MAX_REPAIRS
from beacon_core.repairs import Repairs, mended, place


def test_without_notes_there_are_none() -> None:
    assert Repairs().all() == ()


def test_notes_come_out_in_order_each_with_its_place() -> None:
    repairs = Repairs()
    repairs.note("not an id, cleared", "stable_id")
    repairs.note("not an id, dropped", "function_ids", 3)
    repairs.note("truncated 2048 -> 1024 bytes", "metadata", "foo")
    assert repairs.all() == (
        "$.stable_id: not an id, cleared",
        "$.function_ids[3]: not an id, dropped",
        "$.metadata.foo: truncated 2048 -> 1024 bytes",
    )


def test_as_many_as_the_cap_are_all_shown() -> None:
    lines = noted(MAX_REPAIRS)
    assert len(lines) == MAX_REPAIRS
    assert lines[-1] == f"$.depends_on[{MAX_REPAIRS - 1}]: dropped"


@pytest.mark.parametrize("count", [MAX_REPAIRS + 1, 100_000])
def test_the_last_entry_says_how_many_more_there_were(count: int) -> None:
    lines = noted(count)
    assert len(lines) == MAX_REPAIRS
    assert lines[-2] == f"$.depends_on[{MAX_REPAIRS - 2}]: dropped"
    assert lines[-1] == f"... and {count - MAX_REPAIRS + 1} more"


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (None, "$.metadata"),
        (0, "$.metadata[0]"),
        ("fw-version_2", "$.metadata.fw-version_2"),
        ("", "$.metadata['']"),
        ("a b", "$.metadata['a b']"),
        ("a\n$.entity_id: fine", r"$.metadata['a\n$.entity_id: fine']"),
        ("a\n", r"$.metadata['a\n']"),
        ("n\u0661", r"$.metadata['n\u0661']"),
    ],
)
def test_a_place_cannot_be_misread(part: int | str | None, expected: str) -> None:
    assert place("metadata", part) == expected


@pytest.mark.parametrize("key", ["k" * 64, "k" * 65, "k" * 10**6, "\x1b" * 10**6])
def test_a_place_is_short(key: str) -> None:
    assert len(place("metadata", key)) <= len("$.metadata[]") + MAX_LOG_CHARS


def test_each_lone_surrogate_becomes_one_replacement_character() -> None:
    assert mended("a\ud800\udfffb\udc80") == "a\ufffd\ufffdb\ufffd"


def test_text_that_is_utf8_stays_the_same_object() -> None:
    text = "straße \N{GRINNING FACE}\x00"
    assert mended(text) is text


def noted(count: int) -> tuple[str, ...]:
    repairs = Repairs()
    for index in range(count):
        repairs.note("dropped", "depends_on", index)
    return repairs.all()
