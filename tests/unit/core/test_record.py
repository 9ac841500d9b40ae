"""One entity's record: what it gives out, and how words are merged."""

from __future__ import annotations

from typing import Any

import attrs
import pytest

from beacon_core.claims import Claimant
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.limits import HINT_OVERHEAD_BYTES, MAX_HISTORY
from beacon_core.record import Record, merge
from beacon_core.stored import Claim, StoredHint
from beacon_core.testing.examples import BENCH_HINT

OTHER_WORDS: dict[str, Any] = {
    "stable_id": "other",
    "display_name": "other",
    "function_ids": ("other",),
    "depends_on": ("other",),
    "component_id": "other",
    "transport_type": "other",
    "negotiated_format": "other",
    "process_id": 1,
    "process_name": "other",
    "hostname": "other",
    "metadata": {"other": "other"},
}
"""Another value for each field of the bench hint, except the id."""


def record(hint: BeaconHint = BENCH_HINT) -> Record:
    return Record(Claimant(hint, "s", "i", 5, 100), Status.ACTIVE, Cause.HEARD)


# -- what it gives out ---------------------------------------------------------------------------


def test_a_record_begins_with_its_first_message() -> None:
    begun = record()
    assert begun.entity_id == BENCH_HINT.entity_id
    assert begun.sequence == 5
    assert begun.heard_once
    assert begun.given_out() == StoredHint(
        hint=BENCH_HINT,
        status=Status.ACTIVE,
        cause=Cause.HEARD,
        detail="",
        last_seen_ns=100,
        first_seen_ns=100,
        source="s",
        incarnation="i",
        revision=0,
        restarts=0,
    )


def test_a_record_is_as_large_as_its_words() -> None:
    assert record(BeaconHint("e", display_name="żx")).size == HINT_OVERHEAD_BYTES + 1 + 4


def test_words_that_were_counted_already_are_not_counted_again() -> None:
    message = Claimant(BeaconHint("e"), "s", "i", 5, 100, content_bytes=50)
    assert Record(message, Status.ACTIVE, Cause.HEARD).size == HINT_OVERHEAD_BYTES + 50


def test_the_same_view_is_given_out_while_nothing_happens() -> None:
    kept = record()
    assert kept.given_out() is kept.given_out()


def test_a_view_that_was_given_out_never_changes() -> None:
    kept = record()
    before = kept.given_out()
    kept.last_seen_ns = 200
    after = kept.given_out()
    assert (before.last_seen_ns, after.last_seen_ns) == (100, 200)
    assert not kept.heard_once


def test_a_view_that_was_dropped_is_made_anew() -> None:
    kept = record()
    kept.given_out()
    kept.status, kept.view = Status.STALE, None
    assert kept.given_out().status is Status.STALE


def test_the_claims_are_the_holder_s_and_each_contender_s() -> None:
    kept = record()
    rival = Claimant(BeaconHint(BENCH_HINT.entity_id), "t", "j", 1, 150, contending=True)
    predecessor = Claimant(BeaconHint(BENCH_HINT.entity_id), "u", "k", 1, 50)
    kept.rivals = (predecessor, rival)
    given = kept.given_out()
    assert given.conflict
    assert given.claims == (
        Claim(BENCH_HINT, "s", "i", 100),
        Claim(rival.hint, "t", "j", 150),
    )


def test_a_predecessor_makes_no_conflict() -> None:
    kept = record()
    kept.rivals = (Claimant(BeaconHint(BENCH_HINT.entity_id), "u", "k", 1, 50),)
    assert kept.given_out().claims == ()


def test_the_history_keeps_the_latest_steps() -> None:
    kept = record()
    steps = [Transition(number, Status.STALE, Cause.SILENT) for number in range(MAX_HISTORY + 5)]
    for number, step in enumerate(steps, start=1):
        kept.remember(step)
        assert kept.history == tuple(steps[max(0, number - MAX_HISTORY) : number])


# -- merging -------------------------------------------------------------------------------------


@pytest.mark.parametrize("field", OTHER_WORDS)
def test_a_given_field_overwrites_and_the_others_stay(field: str) -> None:
    said = BeaconHint(BENCH_HINT.entity_id, **{field: OTHER_WORDS[field]})
    merged = merge(BENCH_HINT, said)
    assert merged == attrs.evolve(BENCH_HINT, **{field: OTHER_WORDS[field]})


@pytest.mark.parametrize("field", OTHER_WORDS)
def test_a_field_that_was_never_given_is_filled_in(field: str) -> None:
    bare = BeaconHint(BENCH_HINT.entity_id)
    said = attrs.evolve(bare, **{field: OTHER_WORDS[field]})
    assert merge(bare, said) == said


def test_a_hint_that_gives_everything_replaces_everything() -> None:
    said = BeaconHint(BENCH_HINT.entity_id, **OTHER_WORDS)
    assert merge(BENCH_HINT, said) is said


def test_lists_and_metadata_are_replaced_whole() -> None:
    old = BeaconHint("e", function_ids=("a", "b"), metadata={"k": "1", "l": "2"})
    new = BeaconHint("e", function_ids=("c",), metadata={"m": "3"})
    assert merge(old, new) == new


@pytest.mark.parametrize(
    "said",
    [
        pytest.param(BeaconHint(BENCH_HINT.entity_id), id="nothing"),
        pytest.param(attrs.evolve(BENCH_HINT), id="everything again"),
        pytest.param(
            BeaconHint(BENCH_HINT.entity_id, hostname=BENCH_HINT.hostname), id="a part again"
        ),
        pytest.param(
            attrs.evolve(BENCH_HINT, metadata=dict(reversed(list(BENCH_HINT.metadata.items())))),
            id="metadata in another order",
        ),
    ],
)
def test_words_that_say_nothing_new_leave_the_same_object(said: BeaconHint) -> None:
    assert merge(BENCH_HINT, said) is BENCH_HINT
