"""What must not matter: hostile bytes, floods, crashes, rivals, faulty sinks, other networks."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.outcome import Verdict
from beacon_core.ports.adapter import Malformed
from beacon_core.testing.contract.base import ContractBase, hint, known
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.testing.harness import Harness, Listener
from beacon_core.testing.hostile import HOSTILE_IDS, HOSTILE_PAYLOADS
from beacon_core.testing.strategies import hostile_payloads

__all__ = ["FaultChecks"]

_RATE = 50
_FLOOD = 500


class FaultChecks(ContractBase):
    """The network and everybody on it at their worst."""

    # Hostile bytes

    @pytest.mark.parametrize("kind", HOSTILE_PAYLOADS)
    def test_bytes_that_are_no_hint_are_refused_and_harm_nobody(
        self, harness: Harness, kind: str
    ) -> None:
        self.needs(harness, "raw_payloads")
        if not HOSTILE_PAYLOADS[kind]:
            self.needs(harness, "empty_payloads")
        listener = Listener(harness).start()
        harness.send_raw("hostile", HOSTILE_PAYLOADS[kind])
        self.eventually(
            harness, lambda: listener.count(Verdict.MALFORMED) == 1, "the payload is refused"
        )
        harness.announcer().announce(hint("neighbour"))
        self.active(harness, listener, "neighbour")
        self.conclude(harness, listener)

    @pytest.mark.parametrize("kind", HOSTILE_IDS)
    def test_a_hint_about_an_id_that_is_none_is_refused(self, harness: Harness, kind: str) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        harness.send_raw("hostile", harness.encode(BeaconHint(HOSTILE_IDS[kind])))
        self.eventually(
            harness, lambda: listener.count(Verdict.INVALID) == 1, "the hint is refused"
        )
        harness.announcer().announce(hint("neighbour"))
        self.active(harness, listener, "neighbour")
        self.conclude(harness, listener)

    def test_a_payload_about_another_than_it_may_speak_for_is_refused(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "raw_payloads", "vouches_for_ids")
        listener = Listener(harness).start()
        harness.announcer().announce(hint("engine", "true"))
        self.active(harness, listener, "engine")
        harness.send_raw("stranger", harness.encode(hint("engine", "false")))
        self.eventually(
            harness, lambda: listener.count(Verdict.INVALID) == 1, "the payload is refused"
        )
        assert listener.says("engine", "true")
        self.conclude(harness, listener)

    def test_what_its_own_wire_format_allows_at_its_worst_harms_nobody(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "raw_payloads", "lossless", "every_word")
        listener = Listener(harness).start()
        payloads = list(harness.hostile_payloads.values())
        for payload in payloads:
            harness.send_raw("hostile", payload)
        self.eventually(
            harness, lambda: len(listener.tap.calls) == len(payloads), "every payload is counted"
        )
        harness.announcer().announce(hint("neighbour"))
        self.active(harness, listener, "neighbour")
        assert listener.count(Verdict.FAULT) == 0

    def test_the_decoder_answers_any_bytes_with_a_value(self, harness: Harness) -> None:
        good, rng = harness.encode(BENCH_HINT, 1), random.Random(0)  # noqa: S311
        damaged = [good[:end] for end in range(len(good))]
        for _ in range(500):
            at, byte = rng.randrange(len(good)), rng.randrange(256)
            damaged.append(good[:at] + bytes([byte]) + good[at + 1 :])
        for payload in (*damaged, *HOSTILE_PAYLOADS.values(), *harness.hostile_payloads.values()):
            assert isinstance(harness.adapter.decode(payload), Announcement | Malformed)

        @settings(max_examples=100, deadline=None, database=None, derandomize=True)
        @given(hostile_payloads())
        def answers(payload: bytes) -> None:
            assert isinstance(harness.adapter.decode(payload), Announcement | Malformed)

        answers()

    # Floods

    def test_in_a_flood_every_message_is_counted_and_the_rest_dropped(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "raw_payloads", "lossless", "every_word")
        listener = Listener(harness, source_rate=_RATE).start()
        for number in range(_FLOOD):
            harness.send_raw("noisy", harness.encode(hint("noisy", f"{number}")))
        self.eventually(
            harness, lambda: len(listener.tap.calls) >= _FLOOD, f"{_FLOOD} messages are heard"
        )
        totals = {verdict: count for verdict, count in listener.intake.totals().items() if count}
        assert set(totals) <= {Verdict.NEW, Verdict.CHANGED, Verdict.SOURCE_RATE}
        assert sum(totals.values()) == len(listener.tap.calls) >= _FLOOD
        assert totals[Verdict.NEW] == 1
        assert totals[Verdict.SOURCE_RATE] > 0
        assert totals[Verdict.CHANGED] >= _RATE - 1

    def test_in_a_flood_a_quiet_neighbour_is_heard(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads", "lossless", "every_word", "tells_senders_apart")
        listener = Listener(harness, source_rate=_RATE).start()
        quiet = harness.announcer()
        quiet.announce(hint("quiet", "0"))
        self.active(harness, listener, "quiet")
        for number in range(_FLOOD):
            harness.send_raw("noisy", harness.encode(hint("noisy", f"{number}")))
            if number % 100 == 99:
                quiet.announce(hint("quiet", f"{number}"))
        self.named(harness, listener, "quiet", f"{_FLOOD - 1}")
        self.eventually(
            harness, lambda: listener.count(Verdict.SOURCE_RATE) > 0, "the flood is held back"
        )
        reports = {report.name: report for report in listener.intake.sources()}
        assert Verdict.SOURCE_RATE not in reports[known(listener, "quiet").source].counts

    def test_a_flood_of_garbage_silences_only_its_sender(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads", "lossless", "every_word", "tells_senders_apart")
        listener = Listener(harness, source_rate=_RATE).start()
        for _ in range(_FLOOD):
            harness.send_raw("noisy", b"\0garbage")
        self.eventually(
            harness, lambda: listener.count(Verdict.SOURCE_RATE) > 0, "the flood is held back"
        )
        harness.announcer().announce(hint("quiet"))
        self.active(harness, listener, "quiet")
        self.conclude(harness, listener)

    # Silence and crashes

    def test_who_falls_silent_becomes_stale(self, harness: Harness) -> None:
        listener = Listener(harness, ttl_s=harness.ttl_s).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.heard(harness, listener, "engine")
        with harness.silenced(announcer):
            self.reaches(harness, listener, "engine", Status.STALE)
            assert known(listener, "engine").cause is Cause.SILENT
            self.conclude(harness, listener)

    def test_who_stays_silent_is_gone(self, harness: Harness) -> None:
        listener = Listener(harness, ttl_s=harness.ttl_s, expiry_s=harness.ttl_s * 2).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.eventually(harness, lambda: listener.count(Verdict.NEW) == 1, "engine is heard")
        with harness.silenced(announcer):
            self.reaches(harness, listener, "engine", None)
            assert listener.store.stats().expired == 1
            self.conclude(harness, listener)

    def test_who_speaks_again_is_active_again(self, harness: Harness) -> None:
        listener = Listener(harness, ttl_s=harness.ttl_s).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.heard(harness, listener, "engine")
        with harness.silenced(announcer):
            self.reaches(harness, listener, "engine", Status.STALE)
        announcer.announce(hint("engine"))
        self.eventually(
            harness,
            lambda: Cause.HEARD in _causes_after_silence(listener, "engine"),
            "engine is heard again",
        )

    def test_a_crash_makes_stale_at_once_and_the_reason_is_told(self, harness: Harness) -> None:
        self.needs(harness, "detects_crash")
        listener = Listener(harness).start()
        announcer = harness.announcer(mortal=True)
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        harness.crash(announcer)
        self.reaches(harness, listener, "engine", Status.STALE)
        assert known(listener, "engine").cause is Cause.LOST
        assert known(listener, "engine").detail
        self.conclude(harness, listener)

    def test_a_crash_makes_stale_all_that_the_announcer_spoke_for_and_nobody_else(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "detects_crash", "lossless")
        listener = Listener(harness).start()
        doomed, other = harness.announcer(mortal=True), harness.announcer()
        for number in range(20):
            doomed.announce(hint(f"part-{number}"))
        other.announce(hint("other"))
        self.eventually(harness, lambda: listener.store.size() == 21, "all are known")
        harness.crash(doomed)
        self.eventually(
            harness, lambda: listener.store.stats().stale == 20, "20 entities are stale"
        )
        assert listener.has("other")
        self.conclude(harness, listener)

    def test_a_crash_without_notice_is_silence(self, harness: Harness) -> None:
        listener = Listener(harness, ttl_s=harness.ttl_s).start()
        announcer = harness.announcer(period_s=harness.ttl_s / 8, mortal=True)
        announcer.announce(hint("engine"))
        self.heard(harness, listener, "engine")
        harness.crash(announcer)
        self.reaches(harness, listener, "engine", Status.STALE)
        # Its last word may still be on its way, where the machine held it up.
        harness.wait_until(lambda: False, harness.quiet_s)
        heard = len(listener.tap.calls)
        # That the carrier notices the crash in the end is no word.
        self.never(
            harness,
            lambda: any(call.kind == "offer" for call in listener.tap.calls[heard:]),
            "a word from the dead",
        )

    # Rivals

    def test_two_hosts_with_one_id_are_a_conflict_with_both_claims(self, harness: Harness) -> None:
        self.needs(harness, "tells_senders_apart")
        listener = Listener(harness).start()
        self._announce_from(harness, listener, "host-a")
        harness.announcer().announce(BeaconHint("engine", hostname="host-b"))
        self.eventually(harness, lambda: known(listener, "engine").conflict, "a conflict is seen")
        stored = known(listener, "engine")
        assert [claim.hint.hostname for claim in stored.claims] == ["host-a", "host-b"]
        assert stored.hint.hostname == "host-a"
        self.conclude(harness, listener)

    def test_two_processes_with_one_id_are_a_conflict_once_both_go_on(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "tells_senders_apart", "knows_incarnations")
        listener = Listener(harness).start()
        first, second = harness.announcer(), harness.announcer()
        first.announce(hint("engine", "first"))
        self.named(harness, listener, "engine", "first")
        second.announce(hint("engine", "second"))
        self.named(harness, listener, "engine", "second")
        first.announce(hint("engine", "first"))
        self.eventually(harness, lambda: known(listener, "engine").conflict, "a conflict is seen")
        names = [claim.hint.display_name for claim in known(listener, "engine").claims]
        assert names == ["second", "first"]
        self.conclude(harness, listener)

    def test_a_conflict_ends_when_one_of_the_two_leaves(self, harness: Harness) -> None:
        self.needs(harness, "tells_senders_apart", "has_goodbye")
        listener = Listener(harness).start()
        self._announce_from(harness, listener, "host-a")
        rival = harness.announcer()
        rival.announce(BeaconHint("engine", hostname="host-b"))
        self.eventually(harness, lambda: known(listener, "engine").conflict, "a conflict is seen")
        rival.withdraw("engine")
        self.eventually(
            harness, lambda: not known(listener, "engine").conflict, "the conflict ends"
        )
        assert known(listener, "engine").hint.hostname == "host-a"
        self.conclude(harness, listener)

    # Others

    def test_a_sink_that_raises_does_not_stop_the_source(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        raised: list[int] = []

        def raise_twice() -> None:
            if len(raised) < 2:
                raised.append(1)
                raise RuntimeError("a fault in the sink, made by the contract suite")

        listener.tap.hook = raise_twice
        announcer = harness.announcer()
        for number in range(3):
            announcer.announce(hint(f"part-{number}"))
        self.eventually(harness, lambda: len(raised) == 2, "the sink raises twice")
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        listener.source.health()

    def test_two_networks_do_not_hear_each_other(self, harness: Harness) -> None:
        here, there = Listener(harness).start(), Listener(harness, network=1).start()
        harness.announcer().announce(hint("here"))
        harness.announcer(network=1).announce(hint("there"))
        self.active(harness, here, "here")
        self.active(harness, there, "there")
        self.never(
            harness,
            lambda: here.status("there") is not None or there.status("here") is not None,
            "a hint of the other network",
        )
        self.conclude(harness, here, there)

    def _announce_from(self, harness: Harness, listener: Listener, host: str) -> None:
        harness.announcer().announce(BeaconHint("engine", hostname=host))
        self.active(harness, listener, "engine")


def _causes_after_silence(listener: Listener, entity_id: str) -> list[Cause]:
    """From its history, since a slow machine may see it fall silent once more."""
    causes = [step.cause for step in known(listener, entity_id).history]
    return causes[causes.index(Cause.SILENT) :]
