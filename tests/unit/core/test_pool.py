"""Texts held once: equal hints in, equal hints out, and fewer objects."""

from __future__ import annotations

import attrs

from beacon_core.hint import NO_METADATA, BeaconHint
from beacon_core.pool import Pool
from beacon_core.testing.examples import bench_hint
from beacon_core.wire import json


def as_it_arrives(number: int) -> BeaconHint:
    """The hint as a message brings it: every text an object of its own."""
    announcement = json.decode(json.encode(bench_hint(number)))
    assert not hasattr(announcement, "reason")
    return announcement.hint


def test_a_shared_hint_is_equal_to_the_one_given() -> None:
    for hint in (as_it_arrives(1), BeaconHint("bare"), BeaconHint("m", metadata={"k": "v"})):
        assert Pool(100).share(hint) == hint


def test_what_two_hints_have_in_common_is_one_object() -> None:
    pool = Pool(100)
    one, other = pool.share(as_it_arrives(1)), pool.share(as_it_arrives(2))
    for name in (
        "function_ids",
        "depends_on",
        "component_id",
        "transport_type",
        "negotiated_format",
        "process_name",
        "hostname",
    ):
        assert getattr(one, name) is getattr(other, name)
    assert [*map(id, one.metadata)] == [*map(id, other.metadata)]
    assert [*map(id, one.metadata.values())] == [*map(id, other.metadata.values())]


def test_a_hint_without_metadata_keeps_the_shared_nothing() -> None:
    assert Pool(100).share(BeaconHint("bare")).metadata is NO_METADATA


def test_long_texts_and_lists_are_not_kept() -> None:
    pool = Pool(100)
    text, ids = "x" * 129, tuple(f"f{number}" for number in range(129))
    hint = BeaconHint("e", hostname=text, function_ids=ids)
    shared = pool.share(attrs.evolve(hint))
    other = pool.share(BeaconHint("e", hostname="x" * len(text), function_ids=(*ids,)))
    assert shared.hostname is text
    assert other.hostname is not text
    assert shared.function_ids is ids


def test_a_full_pool_is_emptied_and_fills_again() -> None:
    pool = Pool(2)
    first = pool.share(BeaconHint("a", hostname="host", process_name="name"))
    assert pool.share(BeaconHint("b", hostname="-host"[1:])).hostname is not first.hostname
    again = pool.share(BeaconHint("c", hostname="+host"[1:]))
    assert again.hostname == "host"
