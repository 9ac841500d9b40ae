"""The intake's rules once more, as plainly as they can be written: for the machine to compare with.

It decodes every payload, keeps every message it was ever given, and counts them one by one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import attrs

from tests.property.naive_store import Hint, NaiveStore, Voice

__all__ = ["Account", "NaiveIntake", "Read", "nameless"]

SECOND = 10**9
MAX_PAYLOAD_BYTES = 256 * 1024
BAD_INPUT_COST = 9
WINDOW = 64
ENOUGH_STAMPS = 3
CONVINCING_STAMPS = 4
TOLERATED = 10**9
NAME_CHARACTERS = 256
ACCEPTED = {"new", "changed", "refreshed", "contended", "left", "lost"}
BAD_INPUT = {"too-large", "malformed", "invalid"}


@attrs.define
class Read:
    """What decoder and validator make of a payload; both are somebody else's to test."""

    verdict: str = ""
    """Empty: it is a hint; otherwise why it is none."""
    hint: Hint = attrs.Factory(dict)
    written_id: str = ""
    """The id in the payload, also of a hint that is invalid."""
    stamp: int = 0
    repaired: bool = False


class Bucket:
    """Tokens, counted in the nanoseconds that one takes to grow; full at start."""

    def __init__(self, rate: float, now: int) -> None:
        self.token = math.ceil(SECOND / rate)
        self.capacity = math.floor(rate * self.token)
        self.level, self.at = self.capacity, now

    def fill(self, now: int) -> None:
        self.level = min(self.capacity, self.level + now - self.at)
        self.at = now

    @property
    def spent(self) -> int:
        return self.capacity - self.level

    @property
    def half(self) -> int:
        return (self.capacity - self.token) // 2

    @property
    def has_one(self) -> bool:
        return self.level >= self.token


@attrs.define(eq=False)
class Account:
    name: str
    bucket: Bucket
    full_at: int = 0
    """When its bucket is full again; 0: nothing was ever taken from it."""
    messages: list[str] = attrs.Factory(list)
    """Every message's verdict."""
    settled: bool = False
    repaired: int = 0
    delays: list[int] = attrs.Factory(list)
    """Our wall clock less each stamp, since its clock was last found to have been set."""
    elsewhere: list[int] = attrs.Factory(list)
    """The latest of them in a row that agree with each other, and not with the offset."""
    distrusted: int = 0

    @property
    def offset(self) -> int | None:
        """The smallest delay of the window that is being filled and the full one before it."""
        begin = max(0, (len(self.delays) - 1) // WINDOW - 1) * WINDOW
        return min(self.delays[begin:], default=None)

    def note_delay(self, delay: int) -> None:
        self.delays.append(delay)
        if delay - (self.offset or 0) <= TOLERATED:
            self.elsewhere = []
        elif self.elsewhere and abs(delay - self.elsewhere[0]) <= TOLERATED:
            self.elsewhere.append(delay)
        else:
            self.elsewhere = [delay]
        if len(self.elsewhere) == CONVINCING_STAMPS:
            self.delays, self.elsewhere = [delay] * CONVINCING_STAMPS, []


class NaiveIntake:
    """``read`` stands for decoder and validator. Each operation is told both times."""

    def __init__(
        self,
        store: NaiveStore,
        read: Callable[[bytes], Read],
        *,
        source_rate: float,
        global_rate: float,
        policy: str,
        max_sources: int,
        now: int,
    ) -> None:
        self.store, self.read, self.policy = store, read, policy
        self.source_rate, self.max_sources = source_rate, max_sources
        self.all = Bucket(global_rate, now)
        self.accounts: dict[str, Account] = {}
        self.folded: list[str] = []
        """The verdicts of messages from sources that are told apart no more."""

    def offer(
        self,
        payload: bytes,
        source: str,
        envelope: dict[str, Any],
        now: int,
        wall: int,
    ) -> str:
        account = self._account(source, now)
        verdict = self._admit(account, now)
        if not verdict:
            verdict = self._take(payload, account, envelope, now, wall)
        return self._count(account, verdict, now)

    def goodbye(self, entity_id: str, source: str, incarnation: str, number: int, now: int) -> str:
        account = self._account(source, now)
        speaker = nameless(entity_id, account.name, incarnation, number, now)
        return self._count(account, self.store.depart("goodbye", speaker, now), now)

    def lost(self, entity_id: str, source: str, incarnation: str, reason: str, now: int) -> str:
        account = self._account(source, now)
        speaker = nameless(entity_id, account.name, incarnation, 0, now)
        return self._count(account, self.store.depart("lost", speaker, now, reason), now)

    def totals(self) -> Counter[str]:
        every = Counter(self.folded)
        for account in self.accounts.values():
            every.update(account.messages)
        return every

    def next_token(self, now: int) -> int:
        """In how many nanoseconds somebody who has none left will have one; 0 if all have."""
        buckets = [account.bucket for account in self.accounts.values()]
        waits = [one.token - one.level - (now - one.at) for one in buckets]
        return min((one for one in waits if one > 0), default=0)

    def _take(
        self, payload: bytes, account: Account, envelope: dict[str, Any], now: int, wall: int
    ) -> str:
        sent = self._sent(account, envelope["stamp_ns"], now, wall)
        if len(payload) > MAX_PAYLOAD_BYTES:
            return "too-large"
        read = self.read(payload)
        if read.verdict in ("malformed", "fault"):
            return read.verdict
        if envelope["entity_id"] not in ("", read.written_id) or read.verdict:
            return "invalid"
        if read.stamp:
            sent = self._sent(account, read.stamp, now, wall)
        message = Voice(
            read.hint, account.name, envelope["incarnation"], envelope["sequence"], sent
        )
        verdict = self.store.hear(message, now)
        account.repaired += read.repaired and verdict in ACCEPTED
        return verdict

    def _sent(self, account: Account, stamp: int, now: int, wall: int) -> int:
        if not stamp:
            return now
        told = wall - stamp
        account.note_delay(told)
        known = len(account.delays) >= ENOUGH_STAMPS
        age: int | None = max(0, told)
        if self.policy == "arrival" or (
            self.policy == "auto" and not known and told >= self.store.expiry
        ):
            age = None
        elif self.policy == "auto" and known and abs(account.offset or 0) > TOLERATED:
            age = max(0, told - (account.offset or 0))
        account.distrusted += age != max(0, told)
        return now - (age or 0)

    def _account(self, name: str, now: int) -> Account:
        name = name[:NAME_CHARACTERS]
        if name not in self.accounts:
            if len(self.accounts) >= self.max_sources:
                self._fold(self.max_sources // 10)
            self.accounts[name] = Account(name, Bucket(self.source_rate, now))
        return self.accounts[name]

    def _fold(self, count: int) -> None:
        """Strangers before settled ones; whose bucket has been full for longest first."""
        for account in sorted(self.accounts.values(), key=lambda one: (one.settled, one.full_at))[
            :count
        ]:
            self.folded += account.messages
            del self.accounts[account.name]

    def _admit(self, account: Account, now: int) -> str:
        own, shared = account.bucket, self.all
        own.fill(now)
        shared.fill(now)
        if not own.has_one:
            return "source-rate"
        quiet = account.settled and own.spent <= (own.capacity - own.token) / 2
        if not shared.has_one or (shared.spent > shared.half and not quiet):
            return "global-rate"
        own.level -= own.token
        shared.level -= shared.token
        account.full_at = now + own.spent
        return ""

    def _count(self, account: Account, verdict: str, now: int) -> str:
        account.messages.append(verdict)
        account.settled = account.settled or verdict in ACCEPTED
        if verdict in BAD_INPUT:
            own = account.bucket
            own.level = max(0, own.level - BAD_INPUT_COST * own.token)
            account.full_at = now + own.spent
        return verdict


def nameless(entity_id: str, source: str, incarnation: str, number: int, now: int) -> Voice:
    """One who speaks without any words about itself."""
    return Voice(
        {"entity_id": entity_id, "hostname": "", "process_id": 0}, source, incarnation, number, now
    )
