"""Who has sent something: one account per source, in a bounded table."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping

import attrs

from beacon_core.limits import MAX_SOURCE_NAME, MAX_SOURCES
from beacon_core.outcome import Verdict
from beacon_core.skew import ClockOffset
from beacon_core.token_bucket import FairGate, TokenBucket

__all__ = ["Source", "SourceReport", "Sources"]


class Source:
    """One source's account. Thread rule: none of its own; the intake holds its lock."""

    __slots__ = (
        "bucket",
        "clock",
        "counts",
        "distrusted",
        "name",
        "repaired",
        "settled",
        "skew_reported",
    )

    def __init__(self, name: str, bucket: TokenBucket) -> None:
        self.name = name
        self.bucket = bucket
        self.counts: defaultdict[Verdict, int] = defaultdict(int)
        self.repaired = 0
        self.settled = False
        """Something it sent was accepted; see :mod:`.token_bucket` for what that gives it."""
        self.clock: ClockOffset | None = None
        """Made at its first stamp."""
        self.distrusted = 0
        """Stamps that were not believed."""
        self.skew_reported = False


@attrs.frozen
class SourceReport:
    """What is known of one source, at one moment."""

    name: str
    counts: Mapping[Verdict, int]
    """Messages by verdict; only verdicts that occurred."""
    repaired: int
    """Accepted hints that needed a repair."""
    clock_offset_ns: int | None
    """How far its wall clock is behind ours; ``None`` if it sends no stamps."""
    distrusted_stamps: int
    """Stamps that the skew policy did not believe."""


class Sources:
    """The table, and the sum of all that is not in it any more.

    Thread rule: none of its own; the intake holds its lock.
    """

    def __init__(self, gate: FairGate) -> None:
        self._gate = gate
        self._sources: dict[str, Source] = {}
        self._past: Counter[Verdict] = Counter()
        self.find = self._sources.get
        """The account under a name, or ``None``: one look-up, for the hot path."""

    def meet(self, name: str, now_ns: int) -> Source:
        """The account under a name that ``find`` does not know; opened if need be."""
        # Names come from outside; longer ones share an account.
        name = name[:MAX_SOURCE_NAME]
        source = self._sources.get(name)
        if source is None:
            if len(self._sources) >= MAX_SOURCES:
                self._fold_some()
            source = self._sources[name] = Source(name, self._gate.bucket(now_ns))
        return source

    def totals(self) -> dict[Verdict, int]:
        """Messages by verdict over all sources, those folded away included."""
        total = Counter(self._past)
        for source in self._sources.values():
            total.update(source.counts)
        return {verdict: total[verdict] for verdict in Verdict}

    def reports(self) -> list[SourceReport]:
        """One for each account in the table."""
        return [_report(source) for source in self._sources.values()]

    def _fold_some(self) -> None:
        """Fold a tenth of the table: strangers before settled ones, the longest silent first."""
        by_worth = sorted(
            self._sources.values(), key=lambda one: (one.settled, one.bucket.updated_ns)
        )
        for source in by_worth[: MAX_SOURCES // 10]:
            self._past.update(source.counts)
            del self._sources[source.name]


def _report(source: Source) -> SourceReport:
    return SourceReport(
        name=source.name,
        counts=dict(source.counts),
        repaired=source.repaired,
        clock_offset_ns=None if source.clock is None else source.clock.offset_ns,
        distrusted_stamps=source.distrusted,
    )
