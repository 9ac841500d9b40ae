"""The register: whatever happens to a record is entered into every book."""

from __future__ import annotations

import pytest

from beacon_core.claims import Claimant, visible
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, transition
from beacon_core.limits import hint_bytes
from beacon_core.record import Record
from beacon_core.register import Register
from beacon_core.room import Room

S = 1_000_000_000
TTL, EXPIRY = 10 * S, 300 * S


@pytest.fixture
def book() -> Register:
    return Register(0, ttl_ns=TTL, expiry_ns=EXPIRY, room=Room(3, 10_000))


def claimant(entity_id: str, at_ns: int = 0, **words: object) -> Claimant:
    source = str(words.pop("source", "r1"))
    incarnation = str(words.pop("incarnation", ""))
    contending = bool(words.pop("contending", False))
    hint = BeaconHint(entity_id, **words)  # type: ignore[arg-type]
    return Claimant(hint, source, incarnation, 0, at_ns, contending=contending)


def begin(book: Register, entity_id: str, at_ns: int = 0, now_ns: int = 0) -> Record:
    cause = book.cause_of_hearing(at_ns, now_ns)
    assert cause is not None
    record = Record(claimant(entity_id, at_ns), transition(Status.EXPIRED, cause), cause)
    book.begin(record)
    return record


def sums_hold(book: Register) -> bool:
    """Counts and bytes are those of the records that are there."""
    records = book.records.values()
    by_status = {status: sum(r.status is status for r in records) for status in book.room.count}
    return (
        book.room.count == by_status
        and book.room.total_bytes == sum(record.size for record in records)
        and book.conflicts == sum(bool(visible(record.rivals)) for record in records)
    )


@pytest.mark.parametrize(
    ("age_ns", "cause"),
    [
        (0, Cause.HEARD),
        (TTL - 1, Cause.HEARD),
        (TTL, Cause.HEARD_LATE),
        (EXPIRY - 1, Cause.HEARD_LATE),
        (EXPIRY, None),
    ],
)
def test_the_age_of_a_message_decides_what_it_does(
    book: Register, age_ns: int, cause: Cause | None
) -> None:
    assert book.cause_of_hearing(1000 * S - age_ns, 1000 * S) is cause


def test_a_record_falls_silent_ends_and_is_told_as_gone(book: Register) -> None:
    record = begin(book, "a")
    book.settle(TTL - 1)
    assert record.status is Status.ACTIVE
    book.settle(TTL)
    assert (record.status, record.cause) == (Status.STALE, Cause.SILENT)
    book.settle(EXPIRY - 1)
    assert book.records
    book.settle(EXPIRY)
    assert not book.records
    assert (record.revision, book.expired) == (0, 1)
    assert book.changes(1).gone == ("a",)
    assert sums_hold(book)


def test_time_never_goes_back(book: Register) -> None:
    assert book.settle(5 * S) == 5 * S
    assert book.settle(3 * S) == 5 * S


def test_a_tombstone_lasts_one_ttl_from_the_goodbye(book: Register) -> None:
    record = begin(book, "a")
    book.go(record, Cause.GOODBYE, 4 * S)
    book.file(record)
    book.settle(4 * S + TTL - 1)
    assert record.status is Status.LEFT
    book.settle(4 * S + TTL)
    assert not book.records


def test_changes_are_told_in_the_order_in_which_they_came(book: Register) -> None:
    for entity_id in "abc":
        begin(book, entity_id)
    words = BeaconHint("a", hostname="h")
    book.set_hint(book.records["a"], words, hint_bytes(words))
    assert [one.entity_id for one in book.changes(0).hints] == ["b", "c", "a"]
    delta = book.changes(3)
    assert [one.hint for one in delta.hints] == [words]
    assert (delta.revision, delta.complete, delta.too_old) == (4, False, False)
    assert sums_hold(book)


@pytest.mark.parametrize("revision", [-1, 99])
def test_a_revision_that_is_not_known_is_answered_with_everything(
    book: Register, revision: int
) -> None:
    begin(book, "a")
    changes = book.changes(revision)
    assert (changes.complete, changes.too_old) == (True, True)
    assert len(changes.hints) == 1


def test_an_heir_begins_with_its_own_words_and_counts_as_a_restart(book: Register) -> None:
    record = begin(book, "a")
    heir = claimant("a", 2 * S, incarnation="two", source="r2", display_name="new")
    book.hand_over(record, heir, Cause.HEARD, 2 * S, ())
    assert (record.hint, record.incarnation) == (heir.hint, "two")
    assert (record.restarts, book.restarts) == (1, 1)
    assert record.history[-1].detail == "another source"
    assert sums_hold(book)


def test_the_same_process_that_comes_back_is_no_restart(book: Register) -> None:
    record = begin(book, "a")
    book.go(record, Cause.GOODBYE, S)
    book.hand_over(record, claimant("a", 2 * S), Cause.HEARD, 2 * S, ())
    assert (record.status, record.restarts) == (Status.ACTIVE, 0)


def test_a_contender_inherits_when_the_holder_falls_silent(book: Register) -> None:
    record = begin(book, "a")
    book.set_rivals(record, (claimant("a", 4 * S, source="r2", contending=True),))
    book.file(record)
    assert book.conflicts == 1
    book.settle(TTL)
    assert (record.source, record.status, book.conflicts) == ("r2", Status.ACTIVE, 0)
    assert sums_hold(book)


def test_a_predecessor_is_forgotten_after_a_ttl_and_nobody_notices(book: Register) -> None:
    record = begin(book, "a", at_ns=5 * S, now_ns=5 * S)
    revision = book.revision
    book.set_rivals(record, (claimant("a", 2 * S, source="r0"),))
    book.file(record)
    book.settle(2 * S + TTL)
    assert record.rivals == ()
    assert (record.status, book.revision) == (Status.ACTIVE, revision)


@pytest.mark.parametrize("cause", [Cause.SILENT, Cause.LOST, Cause.GOODBYE])
def test_a_predecessor_is_remembered_for_its_ttl_though_the_holder_has_gone(
    book: Register, cause: Cause
) -> None:
    record = begin(book, "a", at_ns=5 * S, now_ns=5 * S)
    book.set_rivals(record, (claimant("a", 7 * S, source="r0"),))
    book.go(record, cause, 8 * S)
    book.file(record)
    for now_ns, remembered in ((7 * S + TTL - 1, ["r0"]), (7 * S + TTL, [])):
        book.settle(now_ns)
        assert [one.source for one in record.rivals] == remembered
    assert book.records["a"].status is not Status.ACTIVE


def test_of_who_speaks_no_more_the_last_number_is_noted_and_of_who_does_nothing(
    book: Register,
) -> None:
    record = begin(book, "a")

    def run(name: str, number: int) -> Claimant:
        speaker = claimant("a", S, incarnation=name)
        speaker.sequence = number
        return speaker

    def noted() -> dict[str, int]:
        return dict(record.runs)

    book.count(record, run("i", 5))
    book.hand_over(record, run("j", 1), Cause.HEARD, S, (run("i", 6),))
    assert noted() == {}
    book.set_rivals(record, ())
    assert noted() == {"i": 6}
    book.hand_over(record, run("k", 1), Cause.HEARD, S, ())
    assert noted() == {"i": 6, "j": 1}
    # Somebody who speaks for the holder says that it is another run; and then the first is back.
    book.count(record, run("l", 1))
    assert noted() == {"i": 6, "j": 1, "k": 1}
    book.count(record, run("i", 9))
    assert noted() == {"j": 1, "k": 1, "l": 1}
    # Whoever is back makes room before the others are counted.
    book.count(record, run("m", 1))
    assert noted() == {"j": 1, "k": 1, "l": 1, "i": 9}
    book.count(record, run("k", 2))
    assert noted() == {"j": 1, "l": 1, "i": 9, "m": 1}


def test_setting_no_rivals_where_there_are_none_changes_nothing(book: Register) -> None:
    record = begin(book, "a")
    view = record.given_out()
    book.set_rivals(record, ())
    assert record.given_out() is view


def test_learning_the_incarnation_is_a_change_and_learning_it_again_is_none(
    book: Register,
) -> None:
    record = begin(book, "a")
    for _ in range(2):
        book.count(record, claimant("a", incarnation="one"))
        assert (record.incarnation, book.revision) == ("one", 2)


def test_room_is_made_by_the_idle_and_never_by_the_active(book: Register) -> None:
    begin(book, "stale", at_ns=0, now_ns=TTL)
    begin(book, "b", at_ns=TTL, now_ns=TTL)
    assert book.make_room(count=1, size=0)
    assert len(book.records) == 2
    begin(book, "c", at_ns=TTL, now_ns=TTL)
    assert book.make_room(count=1, size=0)
    assert set(book.records) == {"b", "c"}
    begin(book, "d", at_ns=TTL, now_ns=TTL)
    assert not book.make_room(count=1, size=0)
    assert (book.displaced, book.refused) == (1, 1)
    assert sums_hold(book)


def test_the_next_deadline_is_never_missed(book: Register) -> None:
    begin(book, "a", at_ns=0)
    assert book.next_due_ns <= TTL
    book.settle(TTL)
    assert book.next_due_ns <= EXPIRY
    book.settle(EXPIRY)
    assert book.next_due_ns > 2**62
