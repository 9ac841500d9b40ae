"""The caps: the numbers promised, how they hang together, and how a hint is weighed."""

from __future__ import annotations

import gc
import json
import sys
import tracemalloc
from collections.abc import Callable, Iterable
from unittest.mock import patch

import attrs
import pytest

from beacon_core import limits
from beacon_core.clock import ManualClock
from beacon_core.hint import Announcement, BeaconHint
from beacon_core.limits import (
    DEFAULT_LIMITS,
    HINT_OVERHEAD_BYTES,
    LIST_ENTRY_BYTES,
    MAX_HINTS,
    MAX_PAYLOAD_BYTES,
    MAX_STORE_BYTES,
    METADATA_ENTRY_BYTES,
    HintLimits,
    held_bytes,
    hint_bytes,
)
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json as wire_json

FULL = BeaconHint(
    entity_id="x" * 256,
    stable_id="x" * 256,
    display_name="x" * 512,
    function_ids=("x" * 256,) * 100,
    depends_on=("x" * 256,) * 100,
    component_id="x" * 256,
    transport_type="x" * 512,
    negotiated_format="x" * 512,
    process_id=2**32 - 1,
    process_name="x" * 512,
    hostname="x" * 512,
    metadata={f"{n:064}": "x" * 1024 for n in range(50)},
)


def test_a_hint_may_be_as_large_as_upstream_lets_it_be() -> None:
    assert attrs.astuple(HintLimits()) == (256, 512, 100, 100, 50, 64, 1024)
    assert HintLimits() == DEFAULT_LIMITS


def test_a_hint_that_fills_every_limit_fits_into_a_payload_twice() -> None:
    text = json.dumps(attrs.asdict(FULL))
    assert 2 * len(text) < MAX_PAYLOAD_BYTES


def test_a_store_has_room_for_ten_thousand_honest_hints_of_four_kilobytes() -> None:
    assert MAX_HINTS * 4_000 <= MAX_STORE_BYTES


@pytest.mark.parametrize("name", [name for name in limits.__all__ if name.startswith("MAX_")])
def test_every_cap_is_a_whole_number_above_zero(name: str) -> None:
    value = getattr(limits, name)
    assert isinstance(value, int)
    assert value > 0


def test_a_hint_weighs_its_overhead_and_its_text() -> None:
    assert hint_bytes(BeaconHint("")) == HINT_OVERHEAD_BYTES
    assert hint_bytes(BeaconHint("abc")) == HINT_OVERHEAD_BYTES + 3


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
def test_every_string_has_its_weight(field: str) -> None:
    hint = BeaconHint(**{"entity_id": "", field: "12345"})  # type: ignore[arg-type]
    assert hint_bytes(hint) == HINT_OVERHEAD_BYTES + 5


def test_every_entry_of_a_list_and_of_the_metadata_has_its_weight() -> None:
    hint = BeaconHint("", function_ids=("1", "22"), depends_on=("333",), metadata={"4444": "55555"})
    entries = 3 * LIST_ENTRY_BYTES + METADATA_ENTRY_BYTES
    assert hint_bytes(hint) == HINT_OVERHEAD_BYTES + entries + 1 + 2 + 3 + 4 + 5


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("", 0),
        ("abcd", 4),
        ("abcé", 4),
        ("abc日", 8),
        ("abc\N{GRINNING FACE}", 16),
        # Nobody may have validated it.
        ("abc\udcff", 8),
        ("\udcff\N{GRINNING FACE}", 8),
    ],
)
def test_each_character_weighs_as_much_as_the_widest_of_its_text(text: str, size: int) -> None:
    assert held_bytes(text) == size
    # What is left is the same for all, whatever Python's version: not the text, but its object.
    assert 0 < sys.getsizeof(text) - size <= 80
    beside = BeaconHint("", hostname=text, display_name="ab", metadata={"k": text})
    assert hint_bytes(beside) == HINT_OVERHEAD_BYTES + METADATA_ENTRY_BYTES + 3 + 2 * size


def test_the_largest_hint_weighs_what_is_said_of_it() -> None:
    assert 1.1 < hint_bytes(FULL) * MAX_HINTS / 2**30 < 1.25


def test_words_that_were_counted_before_are_not_counted_again() -> None:
    listing = BeaconHint("abc", function_ids=("a",), metadata={"b": "c"})
    assert hint_bytes(listing, 7) == HINT_OVERHEAD_BYTES + 7


# -- against what it takes -----------------------------------------------------------------------


def own_ids(number: int, count: int, letter: str) -> tuple[str, ...]:
    return tuple(f"{letter}{number:04}_{place:02}" for place in range(count))


def own_metadata(number: int, count: int) -> dict[str, str]:
    keys, values = own_ids(number, count, "k"), own_ids(number, count, "v")
    return dict(zip(keys, values, strict=True))


def talkative(number: int) -> BeaconHint:
    """Short words of its own in each single field."""
    words = own_ids(number, 7, "w")
    stable_id, name, component, transport, form, process, host = words
    return BeaconHint(
        f"e{number:04}",
        stable_id=stable_id,
        display_name=name,
        component_id=component,
        transport_type=transport,
        negotiated_format=form,
        process_id=1000 + number,
        process_name=process,
        hostname=host,
    )


UNLIKE_ANY_OTHER: dict[str, tuple[float, Callable[[int], BeaconHint]]] = {
    "single fields": (1.35, talkative),
    "10 ids": (1.35, lambda n: BeaconHint(f"e{n:04}", function_ids=own_ids(n, 10, "f"))),
    "2 entries": (1.35, lambda n: BeaconHint(f"e{n:04}", metadata=own_metadata(n, 2))),
    "50 entries": (1.2, lambda n: BeaconHint(f"e{n:04}", metadata=own_metadata(n, 50))),
    "200 ids": (
        1.2,
        lambda n: BeaconHint(
            f"e{n:04}", function_ids=own_ids(n, 100, "f"), depends_on=own_ids(n, 100, "d")
        ),
    ),
    "50 long values, each with an emoji": (
        1.2,
        lambda n: BeaconHint(
            f"e{n:04}",
            metadata={key: f"{key:x<900}\N{GRINNING FACE}" for key in own_ids(n, 50, "k")},
        ),
    ),
    "200 ids and 50 entries": (
        1.2,
        lambda n: BeaconHint(
            f"e{n:04}",
            function_ids=own_ids(n, 100, "f"),
            depends_on=own_ids(n, 100, "d"),
            metadata=own_metadata(n, 50),
        ),
    ),
}
"""By how much the count may be off, and the hint of a number."""


def held_and_counted(hints: Iterable[BeaconHint]) -> tuple[int, int]:
    """What a store holds when it has heard them all, and what it counts; in bytes."""
    payloads = [wire_json.encode(hint) for hint in hints]
    gc.collect()
    tracemalloc.start()
    try:
        store = HintStore(ManualClock())
        for payload in payloads:
            announcement = wire_json.decode(payload)
            assert isinstance(announcement, Announcement)
            assert store.update(announcement.hint, source="s") is Verdict.NEW
            del announcement
        gc.collect()
        return tracemalloc.get_traced_memory()[0], store.stats().bytes
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("kind", UNLIKE_ANY_OTHER)
def test_a_hint_weighs_about_what_it_holds(kind: str) -> None:
    off_by, make = UNLIKE_ANY_OTHER[kind]
    # The pool of shared texts has a cap of its own.
    with patch("beacon_core.register.MAX_POOLED", 1):
        held, counted = held_and_counted(map(make, range(200)))
    assert held / off_by <= counted <= held * off_by


def test_hints_that_have_much_in_common_weigh_more_than_they_hold() -> None:
    held, counted = held_and_counted(map(bench_hint, range(1000)))
    assert held < counted


def test_ten_thousand_usual_hints_take_a_quarter_of_a_store() -> None:
    assert MAX_HINTS * hint_bytes(bench_hint(1)) < MAX_STORE_BYTES / 4 * 1.05
