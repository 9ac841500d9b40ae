"""A store with its clock, and a short way to speak to it: for the tests of the store."""

from __future__ import annotations

from collections import Counter
from typing import Any

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.limits import hint_bytes
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint

__all__ = ["EXPIRY", "TTL", "House", "S", "check_sums"]

S = 1_000_000_000
TTL, EXPIRY = 10 * S, 300 * S
"""The store's defaults, in nanoseconds."""


class House:
    """A store with its clock, and a short way to speak to it."""

    def __init__(self, **config: Any) -> None:
        self.clock = ManualClock()
        self.store = HintStore(self.clock, **config)

    @property
    def now(self) -> int:
        return self.clock.monotonic_ns()

    def wait(self, ns: int) -> None:
        self.clock.advance(ns)

    def hear(
        self,
        name: str = "e",
        source: str = "r",
        incarnation: str = "",
        sequence: int = 0,
        *,
        age: int | None = None,
        **words: Any,
    ) -> Verdict:
        return self.store.update(
            BeaconHint(name, **words),
            received_at_ns=None if age is None else self.now - age,
            source=source,
            incarnation=incarnation,
            sequence=sequence,
        )

    def get(self, name: str = "e") -> StoredHint:
        stored = self.store.get(name)
        assert stored is not None
        return stored

    def status(self, name: str = "e") -> Status | None:
        stored = self.store.get(name)
        return None if stored is None else stored.status

    def steps(self, name: str = "e") -> list[tuple[int, Status, Cause]]:
        return [(one.at_ns, one.status, one.cause) for one in self.get(name).history]


def check_sums(house: House) -> None:
    """All counts are what counting everything would give."""
    everything = house.store.changes_since(0)
    stats = house.store.stats()
    status = Counter(one.status for one in everything.hints)
    assert (stats.active, stats.stale, stats.left) == tuple(
        status[one] for one in (Status.ACTIVE, Status.STALE, Status.LEFT)
    )
    assert stats.conflicts == sum(one.conflict for one in everything.hints)
    said = [one.hint for one in everything.hints]
    said += [claim.hint for one in everything.hints for claim in one.claims[1:]]
    assert stats.bytes == sum(map(hint_bytes, said))
    revisions = [one.revision for one in everything.hints]
    assert revisions == sorted(set(revisions))
    assert stats.revision == everything.revision >= max(revisions, default=0)
