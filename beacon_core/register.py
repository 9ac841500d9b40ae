"""The register: a store's records, and every book that is kept about them.

A record stands in several books at once: in the order of changes, in the calendar of deadlines, in
the counts of records and bytes, among those that give way. This is the one place where what happens
to a record is entered into all of them, and where time takes effect. What a message means for a
record is decided in :mod:`.store`.
"""

from __future__ import annotations

from itertools import takewhile

from beacon_core.claims import (
    Claimant,
    Runs,
    claimed_bytes,
    count_after,
    freshest_contender,
    last_seen,
    noted,
    same_claimant,
    succession,
    visible,
)
from beacon_core.deadlines import DeadlineQueue
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition, transition
from beacon_core.limits import MAX_POOLED, MAX_REMOVED, hint_bytes
from beacon_core.pool import Pool
from beacon_core.record import Record
from beacon_core.removals import Removals
from beacon_core.room import Room
from beacon_core.stored import Changes

__all__ = ["Register"]

_FOREVER_NS = 2**63


class Register:
    """Thread rule: none of its own; the store holds its lock."""

    def __init__(self, now_ns: int, *, ttl_ns: int, expiry_ns: int, room: Room) -> None:
        """``now_ns``: nothing happens before it. The intervals are the store's."""
        self.ttl_ns = ttl_ns
        self.expiry_ns = expiry_ns
        self.room = room
        self.records: dict[str, Record] = {}
        """In the order of the last change: that is what ``changes_since`` reads, from the end."""
        self.removals = Removals(MAX_REMOVED)
        self.revision = 0
        self.next_due_ns = _FOREVER_NS
        """Before this nothing falls due."""
        self.conflicts = 0
        self.expired = self.displaced = self.refused = self.restarts = 0
        self.pool = Pool(MAX_POOLED)
        self.due: DeadlineQueue[Record] = DeadlineQueue(ttl_ns, self._deadline_ns)
        """When each record falls due. A record's deadline may be moved here directly if nothing
        but its ``last_seen_ns`` has changed."""
        self._now_ns = now_ns

    def settle(self, now_ns: int) -> int:
        """Let everything due take effect; returns the time, which never goes back."""
        self._now_ns = now_ns = max(now_ns, self._now_ns)
        if now_ns >= self.next_due_ns:
            while (due := self.due.pop_due(now_ns)) is not None:
                self._fall_due(due[1], due[0])
            next_ns = self.due.next_deadline_ns()
            self.next_due_ns = _FOREVER_NS if next_ns is None else next_ns
        return now_ns

    def begin(self, record: Record) -> None:
        """Enter a record whose life begins now."""
        self.records[record.entity_id] = record
        self.room.enter(record)
        self._changed(record)
        if record.status is not Status.ACTIVE:
            self.offer_room(record)
        self.file(record)

    def changes(self, revision: int) -> Changes:
        """What :meth:`beacon_core.store.HintStore.changes_since` tells."""
        too_old = revision != 0 and not self.removals.floor <= revision <= self.revision
        complete = too_old or revision == 0
        since = 0 if complete else revision
        latest_first = reversed(self.records.values())
        changed = list(takewhile(lambda one: one.revision > since, latest_first))
        gone = () if complete else self.removals.since(since, self.records)
        hints = tuple(record.given_out() for record in reversed(changed))
        return Changes(self.revision, hints, gone, complete, too_old)

    def cause_of_hearing(self, sent_ns: int, now_ns: int) -> Cause | None:
        """What a message sent then does to a status; ``None``: it is expired on arrival."""
        age_ns = now_ns - sent_ns
        if age_ns >= self.expiry_ns:
            return None
        return Cause.HEARD_LATE if age_ns >= self.ttl_ns else Cause.HEARD

    def file(self, record: Record) -> None:
        """Put the record's next deadline into the queue."""
        deadline_ns = self._deadline_ns(record)
        self.due.schedule(record, deadline_ns)
        self.next_due_ns = min(self.next_due_ns, deadline_ns)

    def go(self, record: Record, cause: Cause, at_ns: int, detail: str = "") -> None:
        """Take one step in the lifecycle."""
        self.room.leave(record)
        record.status = transition(record.status, cause)
        record.cause, record.detail = cause, detail
        self.room.enter(record)
        record.remember(Transition(at_ns, record.status, cause, detail))
        self._changed(record)
        if record.status is not Status.ACTIVE:
            self.offer_room(record)

    def hand_over(
        self,
        record: Record,
        heir: Claimant,
        cause: Cause,
        at_ns: int,
        rivals: tuple[Claimant, ...],
    ) -> None:
        """Begin another claimant's life under this id: nothing of the old one's words stays."""
        if not same_claimant(heir, record):
            record.restarts += 1
            self.restarts += 1
        detail = succession(record, heir)
        hint = self.pool.share(heir.hint)
        before = _runs(record)
        record.source, record.incarnation = heir.source, heir.incarnation
        record.sequence = heir.sequence
        self.set_rivals(record, rivals)
        self._note_who_has_gone(record, before)
        record.last_seen_ns = record.first_seen_ns = heir.last_seen_ns
        self.set_hint(record, hint, hint_bytes(hint) + claimed_bytes(rivals))
        self.go(record, cause, at_ns, detail)
        self.file(record)

    def inherit(self, record: Record, heir: Claimant, at_ns: int, *gone: Claimant) -> None:
        """A contender holds the id from now on; the others stay, and who has gone is remembered."""
        others = tuple(one for one in record.rivals if one is not heir)
        self.hand_over(record, heir, Cause.HEARD, at_ns, others + gone)

    def set_hint(self, record: Record, hint: BeaconHint, size: int) -> None:
        """Replace a record's words; ``size`` is what it is accounted for with them."""
        record.hint = hint
        self.room.resize(record, size)
        self._changed(record)

    def count(self, record: Record, message: Claimant) -> None:
        """Note the number of a message of the holder's."""
        incarnation, sequence = count_after(record, message)
        if incarnation == record.incarnation:
            record.sequence = sequence
            return
        before = _runs(record)
        record.incarnation, record.sequence = incarnation, sequence
        self._note_who_has_gone(record, before)
        self._changed(record)

    def set_rivals(self, record: Record, rivals: tuple[Claimant, ...]) -> None:
        """Say who else speaks, or has spoken, under a record's id."""
        if not (rivals or record.rivals):
            return
        before, after = visible(record.rivals), visible(rivals)
        growth = claimed_bytes(rivals) - claimed_bytes(record.rivals)
        runs = _runs(record)
        self.room.resize(record, record.size + growth)
        record.rivals = rivals
        record.view = None
        self._note_who_has_gone(record, runs)
        if after != before:
            self.conflicts += bool(after) - bool(before)
            self._changed(record)

    def remove(self, record: Record, cause: Cause) -> None:
        """End a record: it is in no book any more."""
        transition(record.status, cause)
        self.room.leave(record)
        self.conflicts -= bool(visible(record.rivals))
        self.due.cancel(record)
        del self.records[record.entity_id]
        record.revision = 0
        self.expired += cause is Cause.LAPSED
        self.displaced += cause is Cause.DISPLACED
        self.revision += 1
        self.removals.add(self.revision, record.entity_id)

    def make_room(self, *, count: int, size: int, grower: Record | None = None) -> bool:
        """Let idle records give way, unless even that is not enough: then nobody does."""
        if self.room.fits(count=count, size=size):
            return True
        if not self.room.can_be_made(count=count, size=size, grower=grower):
            self.refused += 1
            return False
        self.room.victims(
            self.records, count=count, size=size, displace=self._displace, grower=grower
        )
        return True

    def offer_room(self, record: Record) -> None:
        """Enter a record that is not ACTIVE, as it is now, among those that give way."""
        self.room.offer(record, self.records)

    def _fall_due(self, record: Record, at_ns: int) -> None:
        if record.rivals:
            living = (one for one in record.rivals if one.last_seen_ns + self.ttl_ns > at_ns)
            self.set_rivals(record, tuple(living))
        if self._deadline_ns(record) > at_ns:
            self.file(record)
        elif record.status is not Status.ACTIVE:
            self.remove(record, Cause.LAPSED)
        elif (heir := freshest_contender(record.rivals)) is not None:
            self.inherit(record, heir, at_ns)
        else:
            self.go(record, Cause.SILENT, at_ns)
            self.file(record)

    def _deadline_ns(self, record: Record) -> int:
        """When its status ends, or one of its rivals has been silent for ``ttl``."""
        if record.status is Status.STALE:
            end_ns = record.last_seen_ns + self.expiry_ns
        elif record.status is Status.LEFT:
            end_ns = record.history[-1].at_ns + self.ttl_ns
        else:
            end_ns = record.last_seen_ns + self.ttl_ns
        if record.rivals:
            end_ns = min(end_ns, min(map(last_seen, record.rivals)) + self.ttl_ns)
        return end_ns

    def _note_who_has_gone(self, record: Record, before: Runs) -> None:
        """``before``: who spoke under the id until now, of whom some may still be there."""
        present = {incarnation for incarnation, _ in _runs(record)}
        known = tuple(run for run in record.runs if run[0] not in present)
        record.runs = noted(known, [run for run in before if run[0] not in present])

    def _changed(self, record: Record) -> None:
        self.revision += 1
        record.revision = self.revision
        record.view = None
        entity_id = record.hint.entity_id
        self.records[entity_id] = self.records.pop(entity_id)

    def _displace(self, record: Record) -> None:
        self.remove(record, Cause.DISPLACED)


def _runs(record: Record) -> Runs:
    """Who speaks, or has lately spoken, under its id; the holder first."""
    return (
        (record.incarnation, record.sequence),
        *((one.incarnation, one.sequence) for one in record.rivals),
    )
