# ruff: noqa: RUF001 - letters that look like others are wanted here
"""What is announced arrives: whole, in order, unchanged, from each to all."""

from __future__ import annotations

import threading

import attrs
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from beacon_core.hint import BeaconHint
from beacon_core.outcome import Verdict
from beacon_core.testing.contract.base import ContractBase, hint, known
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.testing.harness import Harness, Listener, within
from beacon_core.testing.strategies import hints

__all__ = ["DeliveryChecks"]

_FREE_TEXTS = ("display_name", "transport_type", "negotiated_format", "process_name", "hostname")
_TEXTS = {
    "latin": "Prüfstand Ærø",
    "greek-and-cyrillic": "Κινητήρας Двигатель",
    "right-to-left": "\u202bמנוע المحرك\u202c",
    "cjk": "エンジン 发动机 엔진",
    "beyond-the-first-plane": "🤖\U0001f9d1\u200d\U0001f680 𝔟𝔢𝔞𝔠𝔬𝔫 \U000e0001\U0010fffd",
    "combining": "e\u0301 n\u0303 \u0e01\u0e33",
    "nul-inside": "before\0after",
    "controls": "\x01\t\n\r\x1b[31m\x7f\u2028",
    "syntax": "\"quotes\" 'and' \\backslashes\\ {braces} <tags> %s ${x}",
    "spaces-around": "  spaced  ",
    "byte-order-mark": "\ufeffengine",
    "replacement-and-noncharacters": "\ufffd\uffff",
}


class DeliveryChecks(ContractBase):
    """From ``announce`` to the store."""

    def test_a_hint_arrives(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")
        self.conclude(harness, listener)

    def test_every_field_arrives_intact(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(BENCH_HINT)
        self.active(harness, listener, BENCH_HINT.entity_id)
        assert known(listener, BENCH_HINT.entity_id).hint == BENCH_HINT
        self.conclude(harness, listener)

    def test_fields_that_are_not_given_stay_empty(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(BeaconHint("engine"))
        self.active(harness, listener, "engine")
        assert known(listener, "engine").hint == BeaconHint("engine")
        self.conclude(harness, listener)

    @pytest.mark.parametrize("script", _TEXTS)
    def test_text_of_any_script_arrives_intact(self, harness: Harness, script: str) -> None:
        text = _TEXTS[script]
        if "\0" in text:
            self.needs(harness, "nul_in_text")
        listener = Listener(harness).start()
        said = BeaconHint("engine", display_name=text, hostname=text, metadata={"note": text})
        harness.announcer().announce(said)
        self.active(harness, listener, "engine")
        assert known(listener, "engine").hint == said
        self.conclude(harness, listener)

    def test_any_valid_hint_arrives_intact(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()

        @settings(
            max_examples=40,
            deadline=None,
            database=None,
            derandomize=True,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(hints())
        def arrives(said: BeaconHint) -> None:
            if not harness.capabilities.nul_in_text:
                said = _without_nul(said)
            listener.store.forget()
            announcer.announce(said)
            self.eventually(
                harness, lambda: listener.status(said.entity_id) is not None, f"{said} is heard"
            )
            self.eventually(
                harness, lambda: _is_intact(harness, listener, said), f"{said} is intact"
            )

        arrives()

    def test_what_one_announcer_says_arrives_in_the_order_said(self, harness: Harness) -> None:
        self.needs(harness, "orders", "lossless", "every_word")
        listener = Listener(harness).start()
        announcer = harness.announcer()
        names = [f"name {number}" for number in range(300)]
        announcer.announce(hint("engine", names[0]))
        self.named(harness, listener, "engine", names[0])
        # A source may ask once more whom it has just met; the answer must not overtake the rest.
        harness.wait_until(lambda: False, harness.quiet_s)
        for name in names[1:]:
            announcer.announce(hint("engine", name))
        self.named(harness, listener, "engine", names[-1])

        def changes() -> list[Verdict]:
            heard = [call for call in listener.tap.calls if call.kind == "offer"]
            accepted = [call.verdict for call in heard if call.outcome.accepted]
            return [verdict for verdict in accepted if verdict is not Verdict.REFRESHED]

        # The store has the last one a moment before the call is over.
        harness.wait_until(lambda: len(changes()) >= len(names), harness.patience_s)
        assert changes() == [Verdict.NEW] + [Verdict.CHANGED] * 299
        self.conclude(harness, listener)

    def test_a_change_is_seen_without_waiting_for_the_next_period(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer(period_s=3600.0)
        announcer.announce(hint("engine", "before"))
        self.named(harness, listener, "engine", "before")
        announcer.announce(hint("engine", "after"))
        self.named(harness, listener, "engine", "after")
        self.conclude(harness, listener)

    def test_saying_the_same_again_is_no_change(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(BENCH_HINT)
        self.active(harness, listener, BENCH_HINT.entity_id)
        revision = listener.store.revision
        announcer.announce(BENCH_HINT)
        self.eventually(
            harness, lambda: listener.count(Verdict.REFRESHED) >= 1, "the repetition is heard"
        )
        assert listener.store.revision == revision
        self.conclude(harness, listener)

    def test_an_announcer_with_a_period_repeats_by_itself(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer(period_s=harness.ttl_s / 8).announce(hint("engine"))
        self.active(harness, listener, "engine")
        first_ns = known(listener, "engine").last_seen_ns
        self.eventually(harness, lambda: listener.count(Verdict.REFRESHED) >= 5, "five repetitions")
        assert known(listener, "engine").last_seen_ns > first_ns
        self.conclude(harness, listener)

    def test_an_announcer_without_a_period_speaks_only_when_told(self, harness: Harness) -> None:
        self.needs(harness, "pushes")
        listener = Listener(harness).start()
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")
        # A source may ask once more whom it has just met; that is not unasked.
        harness.wait_until(lambda: False, 1.0)
        heard = len(listener.tap.calls)
        self.never(harness, lambda: len(listener.tap.calls) > heard, "a word unasked")
        self.conclude(harness, listener)

    def test_one_announcer_speaks_for_many_entities(self, harness: Harness) -> None:
        self.needs(harness, "lossless")
        listener = Listener(harness).start()
        announcer = harness.announcer()
        for number in range(200):
            announcer.announce(hint(f"part-{number}", f"Part {number}"))
        self.eventually(harness, lambda: listener.store.size() == 200, "200 entities are known")
        self.conclude(harness, listener)

    def test_repetitions_are_spread_so_that_a_rate_does_not_starve_the_same_ones_for_ever(
        self, harness: Harness
    ) -> None:
        listener = Listener(harness, source_rate=100.0).start()
        announcer = harness.announcer(period_s=2.0)
        for number in range(150):
            announcer.announce(hint(f"part-{number}"))
        self.eventually(harness, lambda: listener.store.size() == 150, "150 entities are known")

    def test_many_announcers_are_heard_side_by_side(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        for number in range(10):
            harness.announcer().announce(hint(f"robot-{number}"))
        self.eventually(harness, lambda: listener.store.size() == 10, "10 announcers are heard")
        self.conclude(harness, listener)

    def test_every_announcer_is_a_sender_of_its_own(self, harness: Harness) -> None:
        self.needs(harness, "tells_senders_apart")
        listener = Listener(harness).start()
        for number in range(3):
            harness.announcer().announce(hint(f"robot-{number}"))
        self.eventually(harness, lambda: listener.store.size() == 3, "3 announcers are heard")
        assert len({stored.source for stored in listener.store.snapshot()}) == 3

    def test_every_source_hears_everything(self, harness: Harness) -> None:
        listeners = [Listener(harness).start() for _ in range(3)]
        harness.announcer().announce(BENCH_HINT)
        for listener in listeners:
            self.active(harness, listener, BENCH_HINT.entity_id)
        self.conclude(harness, *listeners)

    def test_announcing_from_many_threads_loses_nothing(self, harness: Harness) -> None:
        self.needs(harness, "lossless")
        listener = Listener(harness).start()
        announcer = harness.announcer()

        def announce_some(thread: int) -> None:
            for number in range(20):
                announcer.announce(hint(f"part-{thread}-{number}"))

        threads = [threading.Thread(target=announce_some, args=(n,), daemon=True) for n in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            within(harness.patience_s, thread.join)
        self.eventually(harness, lambda: listener.store.size() == 160, "160 entities are known")
        self.conclude(harness, listener)

    def test_sources_in_several_threads_may_share_one_sink(self, harness: Harness) -> None:
        self.needs(harness, "lossless")
        listener = Listener(harness).start()
        second = harness.source()
        second.start(listener.tap)

        def call_the_sink(thread: int) -> None:
            payload = harness.encode(hint(f"direct-{thread}"))
            for _ in range(200):
                listener.tap.offer(payload, f"thread-{thread}")

        threads = [threading.Thread(target=call_the_sink, args=(n,), daemon=True) for n in range(4)]
        for thread in threads:
            thread.start()
        announcer = harness.announcer()
        for number in range(50):
            announcer.announce(hint(f"part-{number}"))
        self.eventually(harness, lambda: listener.store.size() == 54, "54 entities are known")
        for thread in threads:
            within(harness.patience_s, thread.join)
        second.close()
        listener.source.close()
        assert sum(listener.intake.totals().values()) == len(listener.tap.calls)
        assert listener.count(Verdict.FAULT) == 0
        self.conclude(harness, listener)


def _is_intact(harness: Harness, listener: Listener, said: BeaconHint) -> bool:
    stored = listener.store.get(said.entity_id)
    if stored is not None and stored.hint == said:
        return True
    if not harness.capabilities.pushes:
        # What it said before may have been asked for since it was forgotten, and then stays where
        # the new hint gives nothing.
        listener.store.forget()
    return False


def _without_nul(hint: BeaconHint) -> BeaconHint:
    metadata = {key: value.replace("\0", "") for key, value in hint.metadata.items()}
    texts = {name: getattr(hint, name).replace("\0", "") for name in _FREE_TEXTS}
    return attrs.evolve(hint, metadata=metadata, **texts)
