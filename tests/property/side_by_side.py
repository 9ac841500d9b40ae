"""The real thing and the naive one side by side: fed alike, and compared."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from typing import Any
from unittest.mock import patch

import attrs

from beacon_core.clock import Clock
from beacon_core.hint import Announcement, BeaconHint
from beacon_core.intake import Intake
from beacon_core.limits import MAX_CLAIMS, MAX_HISTORY, hint_bytes
from beacon_core.outcome import Outcome
from beacon_core.ports.adapter import Malformed
from beacon_core.store import HintStore
from beacon_core.stored import Changes, StoredHint
from beacon_core.validator import Accepted, validate
from beacon_core.wire import json
from tests.property.drawn import BREAKS_THE_DECODER, Setup
from tests.property.naive_intake import NaiveIntake, Read
from tests.property.naive_store import Entity, Hint, NaiveStore, Picture

__all__ = [
    "Pair",
    "Reader",
    "check_accounts",
    "check_caps",
    "check_changes",
    "check_next_deadline",
    "check_one",
    "check_stats",
    "fields",
    "met",
    "new_pair",
    "seen",
    "unlike",
]

met: Counter[Any] = Counter()
"""Verdicts, and steps in the lifecycle: to see that a whole run has met all there are."""


class Pair:
    """A sink that hands each message to both, and writes down where they disagree."""

    def __init__(self, intake: Intake, naive: NaiveIntake, clock: Clock) -> None:
        self.intake, self.naive, self.clock = intake, naive, clock
        self.disagreements: list[str] = []
        self.messages = self.checked = 0
        self.offers: list[tuple[bytes, str, dict[str, Any]]] = []
        """The latest, to be repeated."""

    def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
        envelope = {"entity_id": "", "stamp_ns": 0, "incarnation": "", "sequence": 0, **envelope}
        outcome = self.intake.offer(payload, source, **envelope)
        now_ns, wall_ns = self.clock.monotonic_ns(), self.clock.wall_ns()
        wanted = self.naive.offer(payload, source, envelope, now_ns, wall_ns)
        self.offers = [*self.offers[-20:], (payload, source, envelope)]
        return self._compare(outcome, wanted, f"offer {payload[:200]!r} {source} {envelope}")

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        outcome = self.intake.goodbye(entity_id, source, incarnation=incarnation, sequence=sequence)
        now_ns = self.clock.monotonic_ns()
        wanted = self.naive.goodbye(entity_id, source, incarnation, sequence, now_ns)
        return self._compare(outcome, wanted, f"goodbye {entity_id} {source} {incarnation}")

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = "cable cut"
    ) -> Outcome:
        outcome = self.intake.lost(entity_id, source, incarnation=incarnation, reason=reason)
        now_ns = self.clock.monotonic_ns()
        wanted = self.naive.lost(entity_id, source, incarnation, reason, now_ns)
        return self._compare(outcome, wanted, f"lost {entity_id} {source} {incarnation}")

    def _compare(self, outcome: Outcome, wanted: str, what: str) -> Outcome:
        self.messages += 1
        met.update([outcome.verdict])
        if outcome.verdict != wanted:
            self.disagreements.append(f"{what}: {outcome.verdict}, not {wanted}")
        return outcome


def new_pair(store: HintStore, naive: NaiveStore, setup: Setup, max_sources: int) -> Pair:
    """Two intakes with the same rules, each in front of its own kind of store."""
    clock = store.clock
    with patch("beacon_core.intake.MAX_REMEMBERED_BYTES", setup.max_remembered):
        intake = Intake(
            store,
            decode,
            source_rate=setup.source_rate,
            global_rate=setup.global_rate,
            skew_policy=setup.policy,
        )
    naive_intake = NaiveIntake(
        naive,
        read,
        source_rate=setup.source_rate,
        global_rate=setup.global_rate,
        policy=setup.policy,
        max_sources=max_sources,
        now=clock.monotonic_ns(),
    )
    return Pair(intake, naive_intake, clock)


def decode(payload: bytes) -> Announcement | Malformed:
    if payload == BREAKS_THE_DECODER:
        raise ZeroDivisionError
    return json.decode(payload)


@lru_cache(1_000)
def read(payload: bytes) -> Read:
    """What the naive intake is told about a payload."""
    if payload == BREAKS_THE_DECODER:
        return Read("fault")
    announcement = decode(payload)
    if isinstance(announcement, Malformed):
        return Read("malformed")
    checked = validate(announcement.hint)
    written_id = announcement.hint.entity_id
    if not isinstance(checked, Accepted):
        return Read("invalid", written_id=written_id)
    repaired = bool(announcement.repairs or checked.repairs)
    return Read("", fields(checked.hint), written_id, announcement.stamp_ns, repaired)


def fields(hint: BeaconHint) -> Hint:
    return {
        "entity_id": hint.entity_id,
        "stable_id": hint.stable_id,
        "display_name": hint.display_name,
        "function_ids": hint.function_ids,
        "depends_on": hint.depends_on,
        "component_id": hint.component_id,
        "transport_type": hint.transport_type,
        "negotiated_format": hint.negotiated_format,
        "process_id": hint.process_id,
        "process_name": hint.process_name,
        "hostname": hint.hostname,
        "metadata": dict(hint.metadata),
    }


def seen(stored: StoredHint) -> Picture:
    """The same as ``naive_store.picture``, of what the store gave out."""
    return (
        fields(stored.hint),
        stored.status,
        stored.cause,
        stored.detail,
        stored.first_seen_ns,
        stored.source,
        stored.incarnation,
        stored.restarts,
        [(fields(one.hint), one.source, one.incarnation) for one in stored.claims],
        [(one.at_ns, one.status, one.cause, one.detail) for one in stored.history],
    )


def unlike(got: dict[str, Picture], wanted: dict[str, Picture]) -> list[tuple[str, Any, Any]]:
    """Where two pictures of everything differ."""
    if got == wanted:
        return []
    nothing: Picture = (None,) * 10
    return [
        (name, one, other)
        for name in {**got, **wanted}
        for one, other in zip(got.get(name, nothing), wanted.get(name, nothing), strict=True)
        if one != other
    ]


# -- somebody who follows the changes ------------------------------------------------------------


class Reader:
    """Knows what it was told, and asks only for what is new."""

    def __init__(self) -> None:
        self.revision = 0
        self.naive_revision = 0
        self.known: dict[str, Picture] = {}

    def follow(self, store: HintStore, naive: NaiveStore) -> None:
        changes = check_changes(store, naive, self.revision, self.naive_revision)
        if changes.complete:
            self.known = {}
        for gone in changes.gone:
            self.known.pop(gone, None)
        for stored in changes.hints:
            # In the order of the changes, so that a dict's order can be compared too.
            self.known.pop(stored.entity_id, None)
            self.known[stored.entity_id] = seen(stored)
        self.revision, self.naive_revision = changes.revision, naive.revision


def check_changes(
    store: HintStore, naive: NaiveStore, revision: int, naive_revision: int
) -> Changes:
    """Ask what has changed since a revision, and compare with what the naive store noted."""
    changes = store.changes_since(revision)
    assert changes.revision == store.revision
    assert changes.too_old == (revision != 0 and naive.too_old(naive_revision))
    assert changes.complete == (changes.too_old or revision == 0)
    since = 0 if changes.complete else naive_revision
    assert [one.entity_id for one in changes.hints] == naive.changed_since(since)
    gone = set() if changes.complete else naive.gone_since(since)
    assert (set(changes.gone), len(changes.gone)) == (gone, len(gone))
    numbers = [one.revision for one in changes.hints]
    assert numbers == sorted(set(numbers))
    assert all((0 if changes.complete else revision) < one <= changes.revision for one in numbers)
    return changes


def check_accounts(pair: Pair, max_sources: int) -> None:
    """Every message is counted, in one verdict, of its source."""
    if pair.checked == pair.messages:
        return
    pair.checked = pair.messages
    totals = pair.intake.totals()
    assert sum(totals.values()) == pair.messages
    assert {verdict: count for verdict, count in totals.items() if count} == pair.naive.totals()
    reports = pair.intake.sources()
    assert len(reports) <= max_sources
    for report, account in zip(reports, pair.naive.accounts.values(), strict=True):
        assert report.name == account.name
        assert report.counts == Counter(account.messages)
        assert report.repaired == account.repaired
        assert report.clock_offset_ns == account.offset
        assert report.distrusted_stamps == account.distrusted


def check_next_deadline(store: HintStore, naive: NaiveStore) -> None:
    """Never late, and early by a sixteenth of a ttl at the most."""
    early, exact = store.next_deadline_ns(), naive.next_deadline()
    assert (early is None) == (exact is None)
    if early is not None and exact is not None:
        assert exact - naive.ttl / 16 <= early <= exact


def check_one(stored: StoredHint, entity: Entity, store: HintStore, now: int) -> None:
    """When it was heard, what is bounded, and that its status is what its age says."""
    assert stored.last_seen_ns == entity.holder.heard
    claimants = [entity.holder, *entity.contenders] if entity.contenders else []
    assert [one.last_seen_ns for one in stored.claims] == [one.heard for one in claimants]
    assert len(stored.claims) <= MAX_CLAIMS
    assert len(stored.history) <= MAX_HISTORY
    age = stored.age_ns(now)
    if stored.status == "left":
        assert stored.cause == "goodbye"
    else:
        assert age < store.expiry_ns
        doubtful = age >= store.ttl_ns or stored.cause == "lost"
        assert stored.status == ("stale" if doubtful else "active")


def check_stats(store: HintStore, naive: NaiveStore, by_id: dict[str, StoredHint]) -> None:
    """Counts and bytes, against the naive ones and against adding everything up."""
    count = Counter(one.status.value for one in by_id.values())
    claims = [one.claims[1:] for one in by_id.values()]
    said = [one.hint for one in by_id.values()]
    said += [one.hint for each in claims for one in each]
    stats = store.stats()
    assert attrs.asdict(stats) == {
        "active": count["active"],
        "stale": count["stale"],
        "left": count["left"],
        "conflicts": sum(map(bool, claims)),
        "bytes": sum(map(hint_bytes, said)),
        "revision": store.revision,
        **naive.totals,
    }
    assert stats.bytes == naive.bytes <= naive.max_bytes
    assert len(by_id) <= naive.max_hints
    assert store.size() == count["active"] + count["stale"]


def check_caps(store: HintStore, pairs: list[Pair], most_records: int, slack: int) -> None:
    """Nothing is larger than what it holds allows, nor than its cap."""
    book, due = store._book, store._book.due
    assert len(book.records) <= most_records <= book.room.max_hints
    assert len(book.removals._log) <= book.removals._limit
    assert len(due._near) <= 2 * most_records + slack
    assert all(due._slots.values())
    assert len(due._slots) <= most_records
    assert len(due._slot_order) <= 2 * most_records + slack + 1
    assert len(book.room._idle) <= 2 * most_records + slack + 1
    for pair in pairs:
        memory = pair.intake._memory
        assert sum(map(len, memory._known)) == memory._bytes <= memory._max_bytes
        assert set(memory._payload_of.values()) == set(memory._known)
