"""The one road in: rate -> size -> (same as before? refresh) -> decode -> validate -> store.

Every adapter's messages end here, so they are all treated alike, and every message ends in exactly
one counter of its source.

An unchanged message is the common one. A payload that is equal, byte for byte, to the last one that
was accepted for an entity from the same announcer needs no decoding: it refreshes. The other way
round is not promised, and nothing depends on it: equal hints may come in different bytes (CDR's
padding is arbitrary), and the memory is bounded.
"""

from __future__ import annotations

import logging

from beacon_core.claims import Claimant
from beacon_core.clock import Clock
from beacon_core.hint import Announcement
from beacon_core.limits import (
    DEFAULT_LIMITS,
    MAX_PAYLOAD_BYTES,
    MAX_REMEMBERED_BYTES,
    MAX_SOURCE_NAME,
    HintLimits,
)
from beacon_core.memory import PayloadMemory
from beacon_core.outcome import ACCEPTED, Outcome, Refusal, Verdict
from beacon_core.ports.adapter import Decoder, Malformed
from beacon_core.skew import ClockOffset, SkewPolicy, trusted_age_ns
from beacon_core.sources import Source, SourceReport, Sources
from beacon_core.store import HintStore
from beacon_core.text import quoted
from beacon_core.token_bucket import FairGate, TokenBucket
from beacon_core.validator import Rejected, clean_size, validate

__all__ = ["Intake"]

_log = logging.getLogger(__name__)

_BAD_INPUT_COST = 9
"""Tokens that a message costs its source beyond the one it took, if it cannot be used: refusing
one is as much work as taking ten."""

_LOG_RATE = 1.0
_LOG_BURST = 20.0
"""Log lines per second, and at once, that all sources together can cause."""

_EVERYDAY = frozenset({Verdict.OLDER, Verdict.BURIED, Verdict.UNKNOWN})
"""What any network does now and then: counted, and nobody needs to read of it."""
_BAD_INPUT = frozenset({Verdict.TOO_LARGE, Verdict.MALFORMED, Verdict.INVALID})
_NONE = (0, "", "")


class Intake:
    """Implements :class:`beacon_core.ports.sink.HintSink` over a store.

    Thread rule: every method may be called from any thread. Messages handed in by one thread take
    effect in that order. No method raises for anything that came from outside.
    """

    def __init__(
        self,
        store: HintStore,
        decode: Decoder,
        *,
        limits: HintLimits = DEFAULT_LIMITS,
        source_rate: float = 100.0,
        global_rate: float = 10_000.0,
        skew_policy: SkewPolicy = SkewPolicy.AUTO,
    ) -> None:
        """Rates in messages per second, each with a burst of one second's worth.

        Raises ``ConfigError`` for rates that are not finite or below 1.
        """
        self.store = store
        self._decode = decode
        self._limits = limits
        self._policy = skew_policy
        self._clock: Clock = store.clock
        self._now_ns = store.clock.monotonic_ns
        # The store's own: the short way needs both, and taking one lock is cheaper than two.
        self._lock = store.lock
        self._acquire, self._release = store.lock.acquire, store.lock.release
        now_ns = self._now_ns()
        self._gate = FairGate(source_rate=source_rate, global_rate=global_rate)
        self._sources = Sources()
        self._memory = PayloadMemory(MAX_REMEMBERED_BYTES)
        self._heard_ns: int | None = None
        self._dropped = {
            Verdict.SOURCE_RATE: _too_fast(Verdict.SOURCE_RATE, source_rate, "one source"),
            Verdict.GLOBAL_RATE: _too_fast(Verdict.GLOBAL_RATE, global_rate, "all sources"),
        }
        # Looked up once: these run for every message.
        self._admit = self._gate.admit
        self._find = self._sources.find
        self._recall = self._memory.recall
        self._refresh = store.refresh
        self._log_lines = TokenBucket(_LOG_RATE, capacity=_LOG_BURST, now_ns=now_ns)
        self._refused: dict[Verdict, tuple[int, str, str]] = {}

    def offer(
        self,
        payload: bytes,
        source: str,
        *,
        entity_id: str = "",
        stamp_ns: int = 0,
        incarnation: str = "",
        sequence: int = 0,
    ) -> Outcome:
        """Hand in one message as it arrived; see the port for the arguments."""
        now_ns = sent_ns = self._now_ns()
        refreshed: Outcome | None = None
        # Not "with": it costs twice as much, and this runs for every message.
        self._acquire()
        self._heard_ns = now_ns
        try:
            account = self._find(source) or self._sources.meet(source)
            dropped = self._admit(account, now_ns, account.settled)
            if dropped is None:
                if stamp_ns:
                    sent_ns = self._sent_ns(account, stamp_ns, now_ns)
                known = None
                if payload == account.payload:
                    known = account.known
                elif account.speaks_for_several:
                    known = self._recall(payload)
                if known is not None:
                    speaker, run, record, version, outcome = known
                    if (
                        speaker is account
                        and run == incarnation
                        and (not entity_id or entity_id == outcome.entity_id)
                        and self._refresh(record, version, sequence, sent_ns, now_ns)
                    ):
                        account.refreshed += 1
                        refreshed = outcome
        finally:
            self._release()
        if stamp_ns:
            self._report_skew(account)
        if refreshed is not None:
            return refreshed
        if dropped is not None:
            return self._finish(account, self._dropped[dropped])
        return self._read(payload, account, entity_id, sent_ns, incarnation, sequence)

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        """The announcer of ``entity_id`` said that it is leaving.

        Not limited in rate: a goodbye ends a claim at most once, and an announcer that closes says
        many at once.
        """
        self._heard_ns = self._now_ns()
        account = self._account(source)
        verdict = self.store.goodbye(
            entity_id,
            source=account.name,
            incarnation=incarnation[:MAX_SOURCE_NAME],
            sequence=sequence,
        )
        return self._finish(account, Outcome(verdict, entity_id))

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = "connection lost"
    ) -> Outcome:
        """The carrier saw the announcer of ``entity_id`` vanish.

        Not limited in rate: it is the carrier that speaks.
        """
        account = self._account(source)
        verdict = self.store.lost(
            entity_id,
            source=account.name,
            incarnation=incarnation[:MAX_SOURCE_NAME],
            reason=reason[:MAX_SOURCE_NAME],
        )
        return self._finish(account, Outcome(verdict, entity_id))

    def totals(self) -> dict[Verdict, int]:
        """Messages by verdict, over all sources that ever spoke; every verdict is a key.

        Each source is counted at one moment, but not all at the same: adding up ten thousand takes
        long enough for messages to come in between.
        """
        with self._lock:
            sources, total = self._sources.all()
        for source in sources:
            total.update(source.all_counts())
        return {verdict: total[verdict] for verdict in Verdict}

    def sources(self) -> list[SourceReport]:
        """One report for each source still told apart; of one moment each, as in ``totals``."""
        with self._lock:
            sources, _ = self._sources.all()
        return [source.report() for source in sources]

    def source_count(self) -> int:
        """How many sources are told apart."""
        return len(self._sources)

    def tokens(self) -> float:
        """How many messages all sources together may send at once before some are dropped."""
        with self._lock:
            return self._gate.tokens(self._now_ns())

    def silence_ns(self) -> int | None:
        """How long ago the last message came, whatever became of it; ``None`` if none ever came.

        What the carrier says of itself (:meth:`lost`) is no message.
        """
        heard_ns = self._heard_ns
        return None if heard_ns is None else max(0, self._now_ns() - heard_ns)

    def refusals(self) -> dict[Verdict, Refusal]:
        """What was turned away so far, by verdict, each with its latest: only what occurred.

        Late words and the like, which any network has now and then, are none. Costs next to
        nothing, unlike ``totals``.
        """
        with self._lock:
            refused = dict(self._refused)
        return {verdict: Refusal(*told) for verdict, told in refused.items()}

    def _account(self, source: str) -> Source:
        with self._lock:
            return self._find(source) or self._sources.meet(source)

    def _read(
        self,
        payload: bytes,
        account: Source,
        entity_id: str,
        sent_ns: int,
        incarnation: str,
        sequence: int,
    ) -> Outcome:
        """The long way: decode, validate, store."""
        if len(payload) > MAX_PAYLOAD_BYTES:
            detail = f"$: {len(payload)} bytes, at most {MAX_PAYLOAD_BYTES} are read"
            return self._finish(account, Outcome(Verdict.TOO_LARGE, detail=detail))
        announcement = self._decoded(payload)
        if isinstance(announcement, Outcome):
            return self._finish(account, announcement)
        if entity_id and announcement.hint.entity_id != entity_id:
            named = quoted(announcement.hint.entity_id)
            detail = f"$.entity_id: {named}, but it may speak for {quoted(entity_id)} only"
            return self._finish(account, Outcome(Verdict.INVALID, detail=detail))
        hint, repairs = announcement.hint, announcement.repairs
        content_bytes = clean_size(hint, self._limits)
        if not content_bytes:
            checked = validate(hint, self._limits)
            if isinstance(checked, Rejected):
                return self._finish(account, Outcome(Verdict.INVALID, detail=checked.reason))
            hint, repairs = checked.hint, repairs + checked.repairs
        stamped = announcement.stamp_ns
        if stamped:
            with self._lock:
                sent_ns = self._sent_ns(account, stamped, self._now_ns())
            self._report_skew(account)
        run = incarnation[:MAX_SOURCE_NAME]
        message = Claimant(hint, account.name, run, sequence, sent_ns, content_bytes)
        with self._lock:
            verdict, record, version = self.store.take(message)
            if verdict in ACCEPTED:
                account.counts[verdict] += 1
                account.settled = True
                account.repaired += bool(repairs)
                # A payload with a stamp of its own is never the same again; one with repairs is
                # read again each time, so that they are reported each time.
                if record is not None and not stamped and not repairs:
                    self._memory.remember(payload, account, run, record, version)
                return Outcome(verdict, hint.entity_id, repairs)
        return self._finish(account, Outcome(verdict, hint.entity_id, repairs))

    def _decoded(self, payload: bytes) -> Announcement | Outcome:
        try:
            announcement = self._decode(payload)
        except Exception as error:  # noqa: BLE001
            # Decoders return what they cannot read; this one is broken, and the road goes on.
            return Outcome(Verdict.FAULT, detail=f"the decoder raised {quoted(repr(error))}")
        if isinstance(announcement, Malformed):
            return Outcome(Verdict.MALFORMED, detail=announcement.reason)
        return announcement

    def _sent_ns(self, account: Source, stamp_ns: int, now_ns: int) -> int:
        """When a stamped message was sent, on our monotonic clock. Called under the lock."""
        clock = account.clock
        if clock is None:
            clock = account.clock = ClockOffset()
        wall_ns = self._clock.wall_ns()
        clock.observe(stamp_ns, wall_ns)
        told_ns = wall_ns - stamp_ns
        age_ns = trusted_age_ns(told_ns, clock, self.store.expiry_ns, self._policy)
        if age_ns != max(0, told_ns):
            account.distrusted += 1
        return now_ns - (age_ns or 0)

    def _report_skew(self, account: Source) -> None:
        """Say once per source that its clock is off."""
        with self._lock:
            clock = account.clock
            news = clock is not None and clock.skewed and not account.skew_reported
            worth_a_line = news and self._log_lines.try_consume(self._now_ns())
            if worth_a_line:
                account.skew_reported = True
        if worth_a_line and clock is not None and clock.offset_ns is not None:
            _log.warning(
                "%s: its clock is %.3f s %s ours; stamps are used by the policy %r",
                quoted(account.name),
                abs(clock.offset_ns) / 1e9,
                "behind" if clock.offset_ns > 0 else "ahead of",
                str(self._policy),
            )

    def _finish(self, account: Source, outcome: Outcome) -> Outcome:
        """Count, charge and report."""
        verdict = outcome.verdict
        with self._lock:
            # The account may have been folded away since it was looked up.
            account = self._find(account.name) or self._sources.meet(account.name)
            account.counts[verdict] += 1
            count = account.counts[verdict]
            if verdict in ACCEPTED:
                account.settled = True
                return outcome
            if verdict not in _EVERYDAY:
                before = self._refused.get(verdict, _NONE)[0]
                self._refused[verdict] = (before + 1, account.name, outcome.detail)
            if verdict in _BAD_INPUT:
                self._gate.charge(account, _BAD_INPUT_COST, self._now_ns())
            worth_a_line = (
                verdict not in _EVERYDAY
                and _is_power_of_ten(count)
                and self._log_lines.try_consume(self._now_ns())
            )
        if worth_a_line:
            _log.warning(
                "%s: %s (%d so far): %s", quoted(account.name), verdict, count, outcome.detail
            )
        return outcome


def _too_fast(verdict: Verdict, rate: float, whose: str) -> Outcome:
    return Outcome(verdict, detail=f"more than {rate:g} messages per second from {whose}")


def _is_power_of_ten(count: int) -> bool:
    """Lines about one thing become rarer as it goes on: the 1st, the 10th, the 100th, ..."""
    return str(count).rstrip("0") == "1"
