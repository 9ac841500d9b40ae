"""The store: every entity's latest hint, its status, and what has changed.

Each method first *settles*: whatever has become due since the last time (a ttl, an expiry, a
tombstone) takes effect at its own time, in order. So status is a function of age in everything
the store gives out, and there is no difference between a store that is swept often and one that is
only read.

Costs: a refresh is O(1); settling costs what expires; ``changes_since`` costs what changed, because
the records are kept in the order of their last change.

Room. Expired hints hold none. When a new id finds the store full, by count or by bytes, others give
way in this order: tombstones; STALE ones that were heard only once (what a flood of invented ids
leaves behind); other STALE ones; the longest silent first. ACTIVE ones never give way: then the new
id is refused. A known id is always refreshed.
"""

from __future__ import annotations

import threading

from beacon_core.checks import at_least_one, nanoseconds
from beacon_core.claims import (
    Claimant,
    claimed_bytes,
    count_after,
    find,
    follows,
    freshest_contender,
    is_new_life,
    last_seen,
    other_host,
    remembered,
    repeats,
    same_claimant,
    seen_to_go,
    told_before,
)
from beacon_core.clock import Clock
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, transition
from beacon_core.limits import MAX_CLAIMS, MAX_HINTS, MAX_STORE_BYTES, hint_bytes
from beacon_core.outcome import Verdict
from beacon_core.record import Record, merge
from beacon_core.register import Register
from beacon_core.room import Room
from beacon_core.stored import Changes, StoredHint, StoreStats

__all__ = ["HintStore"]

_ACTIVE, _STALE, _LEFT = Status.ACTIVE, Status.STALE, Status.LEFT
_HELD = frozenset({Verdict.NEW, Verdict.CHANGED, Verdict.REFRESHED})
_GONE = frozenset({Cause.GOODBYE, Cause.LOST})

_RESTORED = "known from before a restart, and not heard since"


class HintStore:
    """Thread rule: every method may be called from any thread and is atomic: no other method of
    this store is seen half done. No method blocks on anything but the store's own lock, and none
    calls back. Values given out never change.
    """

    def __init__(
        self,
        clock: Clock,
        *,
        ttl_s: float = 10.0,
        expiry_s: float = 300.0,
        max_hints: int = MAX_HINTS,
        max_bytes: int = MAX_STORE_BYTES,
    ) -> None:
        """``ttl_s`` and ``expiry_s`` in seconds; an ``expiry_s`` not above ``ttl_s`` becomes
        10 x ``ttl_s`` (ros2_medkit's rule). ``max_bytes`` as counted by ``limits.hint_bytes``.

        Raises ``ConfigError`` for NaN, infinity, negative times and caps below 1.
        """
        self.clock = clock
        self.ttl_ns = nanoseconds("ttl_s", ttl_s)
        self.expiry_ns = nanoseconds("expiry_s", expiry_s)
        if expiry_s <= ttl_s:
            self.expiry_ns = nanoseconds("10 x ttl_s", 10 * ttl_s)
        room = Room(at_least_one("max_hints", max_hints), at_least_one("max_bytes", max_bytes))
        self._book = Register(
            clock.monotonic_ns(), ttl_ns=self.ttl_ns, expiry_ns=self.expiry_ns, room=room
        )
        self._buried = 0
        self.lock = threading.Lock()
        """Held by each method while it works, and by whoever calls :meth:`take` and
        :meth:`refresh`."""

    def update(
        self,
        hint: BeaconHint,
        *,
        received_at_ns: int | None = None,
        source: str = "",
        incarnation: str = "",
        sequence: int = 0,
    ) -> Verdict:
        """Take a validated hint.

        ``received_at_ns`` is when it was sent, on the monotonic clock (``None``: now; the future
        counts as now). ``source``, ``incarnation`` and ``sequence`` are explained at
        :class:`beacon_core.ports.sink.HintSink`; without a ``source`` the hint makes no claim of
        its own and is merged into whatever is there, as in ros2_medkit.

        Given fields overwrite, fields not given stay; lists and metadata are replaced whole.
        """
        message = Claimant(hint, source, incarnation, sequence, received_at_ns or 0)
        with self.lock:
            return self.take(message, arrived=received_at_ns is None)[0]

    def take(
        self, message: Claimant, *, arrived: bool = False
    ) -> tuple[Verdict, Record | None, int]:
        """``update`` with the message in one piece (it becomes the store's own).

        ``arrived``: it was sent just now, whatever its ``last_seen_ns``. The record and its version
        are for :meth:`refresh`; there is none unless the record now says all that the message says,
        and is ACTIVE and uncontested.

        Thread rule: the caller holds ``self.lock``.
        """
        # Read under the lock, so that whoever comes second is not earlier.
        now_ns = self.clock.monotonic_ns()
        book = self._book
        if now_ns >= book.next_due_ns:
            book.settle(now_ns)
        if arrived or message.last_seen_ns > now_ns:
            message.last_seen_ns = now_ns
        record = book.records.get(message.hint.entity_id)
        if message.sequence and record is not None and follows(message, record):
            # Readings of two clocks jitter, and a wall clock may be set back: numbers do not.
            message.last_seen_ns = max(message.last_seen_ns, record.last_seen_ns)
        if record is None:
            verdict, record = self._begin(message, now_ns)
        elif record.runs and told_before(message, record.runs):
            verdict = Verdict.OLDER
        elif not same_claimant(message, record):
            verdict = self._heard_other(record, message, now_ns)
        elif record.status is _LEFT:
            verdict = self._heard_after_goodbye(record, message, now_ns)
        else:
            verdict = self._heard(record, message, now_ns)
        if record is None or verdict not in _HELD or record.status is not _ACTIVE:
            return verdict, None, 0
        # Numbers of another incarnation, or of none, are not comparable.
        if record.rivals or message.incarnation != record.incarnation:
            return verdict, None, 0
        return verdict, record, record.revision

    def refresh(
        self, record: Record, version: int, sequence: int, sent_ns: int, now_ns: int
    ) -> bool:
        """The short way for a message that says what the holder of ``record`` said last.

        ``record`` and ``version`` are what :meth:`take` returned for that message, which came from
        the same source and incarnation. Both times are on the monotonic clock, ``sent_ns`` not
        after ``now_ns``. ``False``: something is not as it was, or the message is a late one;
        nothing was done, and ``take`` is the way.

        Thread rule: the caller holds ``self.lock``.
        """
        book = self._book
        if now_ns >= book.next_due_ns:
            book.settle(now_ns)
        if record.revision != version or sent_ns < record.last_seen_ns:
            return False
        if sequence:
            if sequence <= record.sequence:
                return False
            record.sequence = sequence
        record.last_seen_ns = sent_ns
        # Nearly always the deadline stays in its slot: then there is nothing to re-file.
        if sent_ns + self.ttl_ns >= record.slot_end_ns:
            book.due.schedule(record, sent_ns + self.ttl_ns)
        return True

    def goodbye(
        self, entity_id: str, *, source: str = "", incarnation: str = "", sequence: int = 0
    ) -> Verdict:
        """Its announcer left on purpose. ``UNKNOWN`` if the speaker claims no such id."""
        leaving = (entity_id, source, incarnation, sequence)
        return self._depart(leaving, Cause.GOODBYE, Verdict.LEFT, "")

    def lost(
        self,
        entity_id: str,
        *,
        source: str = "",
        incarnation: str = "",
        reason: str = "connection lost",
    ) -> Verdict:
        """The carrier saw its announcer vanish: STALE at once, with ``reason`` as its detail."""
        return self._depart((entity_id, source, incarnation, 0), Cause.LOST, Verdict.LOST, reason)

    def restore(
        self,
        hint: BeaconHint,
        *,
        last_seen_ns: int,
        source: str = "",
        incarnation: str = "",
        restarts: int = 0,
    ) -> Verdict:
        """Take a validated hint that another store knew before: STALE until it is heard.

        ``last_seen_ns`` as that store had it, on this monotonic clock (so it may be below 0); the
        future counts as now. Whoever is heard as the same ``source`` and ``incarnation`` goes on
        living; anybody else is a restart, on top of ``restarts``.

        Returns ``NEW``; ``OLDER`` if the id is known already, or the hint has expired; or
        ``STORE_FULL``.
        """
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            now_ns = self._book.settle(now_ns)
            seen_ns = min(last_seen_ns, now_ns)
            if hint.entity_id in self._book.records or now_ns - seen_ns >= self.expiry_ns:
                return Verdict.OLDER
            known = Claimant(self._book.pool.share(hint), source, incarnation, 0, seen_ns)
            record = Record(known, transition(Status.EXPIRED, Cause.HEARD_LATE), Cause.HEARD_LATE)
            record.detail, record.restarts = _RESTORED, restarts
            if not self._book.make_room(count=1, size=record.size):
                return Verdict.STORE_FULL
            self._book.begin(record)
            return Verdict.NEW

    def forget(self, entity_id: str | None = None) -> int:
        """Forget one entity, or all with ``None``; returns how many there were."""
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            self._book.settle(now_ns)
            ids = list(self._book.records) if entity_id is None else [entity_id]
            records = [self._book.records[one] for one in ids if one in self._book.records]
            for record in records:
                self._book.remove(record, Cause.FORGOTTEN)
            return len(records)

    def get(self, entity_id: str) -> StoredHint | None:
        """The entity as it is now; it may be LEFT, and is never an expired one."""
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            self._book.settle(now_ns)
            record = self._book.records.get(entity_id)
            return None if record is None else record.given_out()

    def last_seen_ns(self, entity_id: str) -> int | None:
        """When it was last heard, on the monotonic clock."""
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            self._book.settle(now_ns)
            record = self._book.records.get(entity_id)
            return None if record is None else record.last_seen_ns

    def snapshot(self) -> list[StoredHint]:
        """All ACTIVE and STALE ones at one moment, in the order of their last change.

        Costs a reference for each record that was not even refreshed since the last time.
        """
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            self._book.settle(now_ns)
            return [
                one.given_out() for one in self._book.records.values() if one.status is not _LEFT
            ]

    def changes_since(self, revision: int) -> Changes:
        """What has changed after ``revision``; 0 asks for everything.

        A revision that is older than what is remembered, or that this store has not reached, is
        answered with everything too, and says so.
        """
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            self._book.settle(now_ns)
            return self._book.changes(revision)

    def sweep(self) -> int:
        """Settle what is due; returns how many changes that made.

        An entity that has gone STALE and ended since the last time counts twice.
        """
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            before = self._book.revision
            self._book.settle(now_ns)
            return self._book.revision - before

    def next_deadline_ns(self) -> int | None:
        """When to ``sweep`` next, on the monotonic clock; ``None``: there is nothing to wait for.

        Never after the next thing is due, and at most a sixteenth of ``ttl`` before it.
        """
        with self.lock:
            return self._book.due.next_deadline_ns()

    @property
    def revision(self) -> int:
        """Rises with every change; a refresh is no change. 0 only before the first.

        It is read as it is: what time has changed counts when it is settled.
        """
        return self._book.revision

    def size(self) -> int:
        """How many are ACTIVE or STALE."""
        stats = self.stats()
        return stats.active + stats.stale

    def stats(self) -> StoreStats:
        """All counts, at one moment."""
        now_ns = self.clock.monotonic_ns()
        with self.lock:
            self._book.settle(now_ns)
            return StoreStats(
                active=self._book.room.count[_ACTIVE],
                stale=self._book.room.count[_STALE],
                left=self._book.room.count[_LEFT],
                conflicts=self._book.conflicts,
                bytes=self._book.room.total_bytes,
                revision=self._book.revision,
                expired=self._book.expired,
                displaced=self._book.displaced,
                refused=self._book.refused,
                restarts=self._book.restarts,
                buried=self._buried,
            )

    def _begin(self, message: Claimant, now_ns: int) -> tuple[Verdict, Record | None]:
        cause = self._book.cause_of_hearing(message.last_seen_ns, now_ns)
        if cause is None:
            return Verdict.OLDER, None
        message.hint = self._book.pool.share(message.hint)
        record = Record(message, transition(Status.EXPIRED, cause), cause)
        if not self._book.make_room(count=1, size=record.size):
            return Verdict.STORE_FULL, None
        self._book.begin(record)
        return Verdict.NEW, record

    def _heard(self, record: Record, message: Claimant, now_ns: int) -> Verdict:
        sent_ns = message.last_seen_ns
        if sent_ns < record.last_seen_ns or (message.sequence and repeats(message, record)):
            return Verdict.OLDER
        if record.status is _ACTIVE and not record.rivals:
            if message.sequence or message.incarnation:
                self._book.count(record, message)
            record.last_seen_ns = sent_ns
            if sent_ns + self.ttl_ns >= record.slot_end_ns:
                self._book.due.schedule(record, sent_ns + self.ttl_ns)
            return self._merge(record, message)
        if record.cause is Cause.LOST and sent_ns < record.history[-1].at_ns:
            return Verdict.OLDER
        cause = self._book.cause_of_hearing(sent_ns, now_ns)
        self._book.count(record, message)
        record.last_seen_ns = sent_ns
        if record.status is _STALE:
            if cause is Cause.HEARD:
                self._book.go(record, cause, now_ns)
            else:
                self._book.offer_room(record)
        self._book.file(record)
        return self._merge(record, message)

    def _merge(self, record: Record, message: Claimant) -> Verdict:
        merged = merge(record.hint, message.hint)
        if merged is record.hint:
            return Verdict.REFRESHED
        size = hint_bytes(merged, message.content_bytes if merged is message.hint else 0)
        if record.rivals:
            size += claimed_bytes(record.rivals)
        growth = size - record.size
        if growth > 0 and not self._book.make_room(count=0, size=growth, grower=record):
            return Verdict.STORE_FULL
        self._book.set_hint(record, merged, size)
        return Verdict.CHANGED

    def _heard_other(self, record: Record, message: Claimant, now_ns: int) -> Verdict:
        rival = find(record.rivals, message)
        known = record if rival is None else rival
        if follows(message, known):
            message.last_seen_ns = max(message.last_seen_ns, known.last_seen_ns)
        if message.last_seen_ns < known.last_seen_ns:
            return Verdict.OLDER
        if rival is not None:
            return self._heard_rival(record, rival, message, now_ns)
        if record.status is _ACTIVE and other_host(message, record):
            return self._contend(record, None, message)
        return self._succeed(record, message, now_ns)

    def _heard_rival(
        self, record: Record, rival: Claimant, message: Claimant, now_ns: int
    ) -> Verdict:
        """A contender, or a predecessor: it may be a late word of one who speaks no more."""
        if rival.departed and not is_new_life(message, rival):
            self._buried += 1
            return Verdict.BURIED
        if repeats(message, rival):
            return Verdict.OLDER
        if record.status is _ACTIVE:
            return self._contend(record, rival, message)
        if message.last_seen_ns < record.last_seen_ns or not is_new_life(message, rival):
            return Verdict.OLDER
        return self._succeed(record, message, now_ns)

    def _heard_after_goodbye(self, record: Record, message: Claimant, now_ns: int) -> Verdict:
        if message.last_seen_ns < record.last_seen_ns:
            return Verdict.OLDER
        if not is_new_life(message, record):
            self._buried += 1
            return Verdict.BURIED
        return self._succeed(record, message, now_ns)

    def _contend(self, record: Record, rival: Claimant | None, message: Claimant) -> Verdict:
        if rival is not None:
            message.incarnation, message.sequence = count_after(rival, message)
        message.contending = True
        others = [one for one in record.rivals if one is not rival]
        # The holder is a claimant too; the one that was heard longest ago gives way.
        others.sort(key=last_seen)
        rivals = (*others[-(MAX_CLAIMS - 2) :], message)
        growth = claimed_bytes(rivals) - claimed_bytes(record.rivals)
        if not self._book.make_room(count=0, size=growth, grower=record):
            return Verdict.STORE_FULL
        self._book.set_rivals(record, rivals)
        self._book.file(record)
        return Verdict.CONTENDED

    def _succeed(self, record: Record, message: Claimant, now_ns: int) -> Verdict:
        """Another process takes over the id, or the same one comes back after its goodbye."""
        cause = self._book.cause_of_hearing(message.last_seen_ns, now_ns)
        if cause is None:
            return Verdict.OLDER
        remaining = (one for one in record.rivals if not same_claimant(message, one))
        others = sorted(remaining, key=last_seen)
        rivals = (*others[-(MAX_CLAIMS - 2) :], *self._predecessor(record, message, now_ns))
        size = hint_bytes(message.hint) + claimed_bytes(rivals)
        if not self._book.make_room(count=0, size=size - record.size, grower=record):
            return Verdict.STORE_FULL
        self._book.hand_over(record, message, cause, now_ns, rivals)
        return Verdict.CHANGED

    def _predecessor(self, record: Record, heir: Claimant, now_ns: int) -> tuple[Claimant, ...]:
        """The holder, to be remembered beside its heir, unless it has been silent for ``ttl``."""
        if same_claimant(heir, record):
            return ()
        gone = remembered(record)
        if record.cause in _GONE:
            gone.last_seen_ns = max(gone.last_seen_ns, record.history[-1].at_ns)
            gone.departed = record.cause is Cause.GOODBYE
        return (gone,) if gone.last_seen_ns + self.ttl_ns > now_ns else ()

    def _depart(
        self, leaving: tuple[str, str, str, int], cause: Cause, verdict: Verdict, detail: str
    ) -> Verdict:
        now_ns = self.clock.monotonic_ns()
        entity_id, source, incarnation, sequence = leaving
        with self.lock:
            now_ns = self._book.settle(now_ns)
            record = self._book.records.get(entity_id)
            if record is None:
                return Verdict.UNKNOWN
            speaker = Claimant(BeaconHint(entity_id), source, incarnation, sequence, now_ns)
            if not same_claimant(speaker, record):
                return self._rival_departs(record, speaker, cause, verdict)
            if record.status is _LEFT or record.cause is cause or repeats(speaker, record):
                return Verdict.OLDER
            self._book.count(record, speaker)
            heir = freshest_contender(record.rivals)
            if heir is None:
                self._book.go(record, cause, now_ns, detail)
                self._book.file(record)
            else:
                gone = seen_to_go(record, speaker, goodbye=cause is Cause.GOODBYE)
                self._book.inherit(record, heir, now_ns, gone)
            return verdict

    def _rival_departs(
        self, record: Record, speaker: Claimant, cause: Cause, verdict: Verdict
    ) -> Verdict:
        rival = find(record.rivals, speaker)
        if rival is None:
            return Verdict.UNKNOWN
        if rival.departed or repeats(speaker, rival):
            return Verdict.OLDER
        others = (one for one in record.rivals if one is not rival)
        gone = seen_to_go(rival, speaker, goodbye=cause is Cause.GOODBYE)
        self._book.set_rivals(record, (*others, gone))
        self._book.file(record)
        return verdict
