"""Who has sent something: one account per source, in a bounded table."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping

import attrs

from beacon_core.limits import MAX_SOURCE_NAME, MAX_SOURCES
from beacon_core.outcome import Outcome, Verdict
from beacon_core.record import Record
from beacon_core.skew import ClockOffset

__all__ = ["Known", "Source", "SourceReport", "Sources"]

Known = tuple["Source", str, Record, int, Outcome]
"""A payload that was accepted: who sent it, in which incarnation; the record it led to, in which
version; and the outcome of hearing it again."""


class Source:
    """One source's account: its bucket, and what is known of it.

    Thread rule: none of its own; the intake holds its lock.
    """

    __slots__ = (
        "busy_until_ns",
        "clock",
        "counts",
        "distrusted",
        "known",
        "name",
        "payload",
        "refreshed",
        "repaired",
        "settled",
        "skew_reported",
        "speaks_for_several",
    )

    def __init__(self, name: str) -> None:
        self.name = name
        self.busy_until_ns = 0
        """Its bucket; see :class:`beacon_core.token_bucket.FairGate`."""
        self.payload = b""
        """The last payload of an entity it speaks for, and below what is known of it."""
        self.known: Known | None = None
        self.speaks_for_several = False
        """Some of its payloads are in the table of :class:`beacon_core.memory.PayloadMemory`."""
        self.refreshed = 0
        """The count that nearly every message goes to, kept apart from the others for speed."""
        self.counts: defaultdict[Verdict, int] = defaultdict(int)
        self.repaired = 0
        self.settled = False
        """Something it sent was accepted; see :mod:`.token_bucket` for what that gives it."""
        self.clock: ClockOffset | None = None
        """Made at its first stamp."""
        self.distrusted = 0
        """Stamps that were not taken as they were."""
        self.skew_reported = False

    def report(self) -> SourceReport:
        """What is known of it, at this moment."""
        return SourceReport(
            name=self.name,
            counts=self.all_counts(),
            repaired=self.repaired,
            clock_offset_ns=None if self.clock is None else self.clock.offset_ns,
            distrusted_stamps=self.distrusted,
        )

    def all_counts(self) -> dict[Verdict, int]:
        """Messages by verdict; only verdicts that occurred."""
        counts = dict(self.counts)
        if self.refreshed:
            counts[Verdict.REFRESHED] = counts.get(Verdict.REFRESHED, 0) + self.refreshed
        return counts


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
    """Stamps that the skew policy did not take as they were."""


class Sources:
    """The table, and the sum of all that is not in it any more.

    Thread rule: none of its own; the intake holds its lock.
    """

    def __init__(self) -> None:
        self._sources: dict[str, Source] = {}
        self._past: Counter[Verdict] = Counter()
        self.find = self._sources.get
        """The account under a name, or ``None``: one look-up, for the hot path."""

    def meet(self, name: str) -> Source:
        """The account under a name that ``find`` does not know; opened if need be."""
        # Names come from outside; longer ones share an account.
        name = name[:MAX_SOURCE_NAME]
        source = self._sources.get(name)
        if source is None:
            if len(self._sources) >= MAX_SOURCES:
                self._fold_some()
            source = self._sources[name] = Source(name)
        return source

    def __len__(self) -> int:
        return len(self._sources)

    def all(self) -> tuple[list[Source], Counter[Verdict]]:
        """Every account, and the sum of those that were folded away: quickly, to be read later."""
        return [*self._sources.values()], Counter(self._past)

    def _fold_some(self) -> None:
        """Fold a tenth of the table: strangers before settled ones, the longest silent first."""
        by_worth = sorted(self._sources.values(), key=lambda one: (one.settled, one.busy_until_ns))
        for source in by_worth[: MAX_SOURCES // 10]:
            self._past.update(source.all_counts())
            del self._sources[source.name]
