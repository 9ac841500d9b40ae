"""Coming, going, coming back: goodbyes, late joiners, and restarts of either end."""

from __future__ import annotations

from beacon_core.lifecycle import Cause, Status
from beacon_core.outcome import Verdict
from beacon_core.testing.contract.base import ContractBase, hint, known
from beacon_core.testing.harness import Harness, Listener

__all__ = ["LifecycleChecks"]


class LifecycleChecks(ContractBase):
    """The lives of announcers and sources, as the store tells them."""

    # Goodbyes

    def test_who_is_withdrawn_has_left(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye")
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        announcer.announce(hint("brake"))
        self.active(harness, listener, "engine", "brake")
        announcer.withdraw("engine")
        self.reaches(harness, listener, "engine", Status.LEFT)
        assert known(listener, "engine").cause is Cause.GOODBYE
        assert listener.has("brake")
        self.conclude(harness, listener)

    def test_an_announcer_that_closes_says_goodbye_for_all(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye")
        listener = Listener(harness).start()
        announcer = harness.announcer(period_s=harness.ttl_s / 8)
        for name in ("engine", "brake", "light"):
            announcer.announce(hint(name))
        self.active(harness, listener, "engine", "brake", "light")
        announcer.close()
        for name in ("engine", "brake", "light"):
            self.reaches(harness, listener, name, Status.LEFT)
        self.conclude(harness, listener)

    def test_withdrawing_an_unknown_entity_is_ignored(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.withdraw("nobody")
        announcer.announce(hint("engine"))
        announcer.withdraw("nobody")
        self.active(harness, listener, "engine")
        self.conclude(harness, listener)

    def test_nobody_can_withdraw_what_somebody_else_announced(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")
        other = harness.announcer()
        other.announce(hint("brake"))
        other.withdraw("engine")
        other.close()
        self.never(harness, lambda: not listener.has("engine"), "engine was sent away")

    def test_a_withdrawn_hint_is_not_repeated(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye")
        listener = Listener(harness).start()
        announcer = harness.announcer(period_s=harness.ttl_s / 8)
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        announcer.withdraw("engine")
        self.reaches(harness, listener, "engine", Status.LEFT)
        heard = len(listener.tap.calls)
        self.never(
            harness,
            lambda: any(call.kind == "offer" for call in listener.tap.calls[heard:]),
            "a repetition after the goodbye",
        )

    def test_a_message_under_way_at_the_goodbye_does_not_revive(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye")
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        announcer.withdraw("engine")
        self.reaches(harness, listener, "engine", Status.LEFT)
        late = next(call for call in listener.tap.calls if call.kind == "offer")
        assert listener.tap.repeat(late).verdict in (Verdict.BURIED, Verdict.OLDER)
        assert listener.has("engine", Status.LEFT)
        self.conclude(harness, listener)

    def test_who_left_is_forgotten_after_the_time_to_live(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye")
        listener = Listener(harness, ttl_s=harness.ttl_s).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.heard(harness, listener, "engine")
        announcer.withdraw("engine")
        self.eventually(harness, lambda: listener.count(Verdict.LEFT) == 1, "the goodbye is heard")
        self.reaches(harness, listener, "engine", None)
        self.conclude(harness, listener)

    def test_who_left_may_come_back(self, harness: Harness) -> None:
        self.needs(harness, "has_goodbye", "knows_incarnations")
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine", "first life"))
        self.active(harness, listener, "engine")
        announcer.withdraw("engine")
        self.reaches(harness, listener, "engine", Status.LEFT)
        announcer.announce(hint("engine", "second life"))
        self.active(harness, listener, "engine")
        assert listener.says("engine", "second life")
        self.conclude(harness, listener)

    # Late joiners

    def test_a_source_that_starts_late_sees_the_present(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present")
        early, late = Listener(harness).start(), Listener(harness)
        announcer = harness.announcer()
        announcer.announce(hint("engine", "first"))
        announcer.announce(hint("engine", "second"))
        self.named(harness, early, "engine", "second")
        late.start()
        self.named(harness, late, "engine", "second")
        self.conclude(harness, early, late)

    def test_a_source_that_starts_late_sees_all_of_many(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present", "lossless")
        announcer = harness.announcer()
        for number in range(400):
            announcer.announce(hint(f"part-{number}"))
        late = Listener(harness).start()
        self.eventually(harness, lambda: late.store.size() == 400, "400 entities are known")
        self.conclude(harness, late)

    def test_a_source_that_starts_late_does_not_see_who_has_left(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present", "has_goodbye")
        early, late = Listener(harness).start(), Listener(harness)
        announcer = harness.announcer()
        announcer.announce(hint("gone"))
        announcer.announce(hint("here"))
        self.active(harness, early, "gone", "here")
        announcer.withdraw("gone")
        self.reaches(harness, early, "gone", Status.LEFT)
        late.start()
        self.active(harness, late, "here")
        self.never(harness, lambda: late.status("gone") is not None, "the one that left is seen")
        self.conclude(harness, late)

    def test_a_source_that_starts_late_does_not_see_who_has_crashed(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present", "detects_crash")
        early, late = Listener(harness).start(), Listener(harness)
        doomed = harness.announcer(mortal=True)
        doomed.announce(hint("gone"))
        harness.announcer().announce(hint("here"))
        self.active(harness, early, "gone", "here")
        harness.crash(doomed)
        self.reaches(harness, early, "gone", Status.STALE)
        late.start()
        self.active(harness, late, "here")
        self.never(harness, lambda: late.status("gone") is not None, "the one that crashed is seen")
        self.conclude(harness, late)

    def test_a_source_that_starts_late_sees_what_was_said_long_ago(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present")
        early = Listener(harness, ttl_s=harness.ttl_s).start()
        late = Listener(harness, ttl_s=harness.ttl_s)
        announcer = harness.announcer()
        announcer.announce(hint("engine", "said once"))
        self.heard(harness, early, "engine")
        with harness.silenced(announcer):
            self.reaches(harness, early, "engine", Status.STALE)
        late.start()
        self.named(harness, late, "engine", "said once")

    # Restarts

    def test_a_restarted_source_hears_what_it_missed(self, harness: Harness) -> None:
        self.needs(harness, "late_joiner_sees_present")
        listener, other = Listener(harness).start(), Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine", "before"))
        self.named(harness, listener, "engine", "before")
        listener.source.close()
        announcer.announce(hint("engine", "meanwhile"))
        self.named(harness, other, "engine", "meanwhile")
        assert listener.says("engine", "before")
        listener.restart()
        self.named(harness, listener, "engine", "meanwhile")
        self.conclude(harness, listener)

    def test_a_restarted_source_hears_what_follows(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine", "before"))
        self.named(harness, listener, "engine", "before")
        for number in range(3):
            listener.restart()
            announcer.announce(hint("engine", f"after {number}"))
            self.named(harness, listener, "engine", f"after {number}")
        assert known(listener, "engine").restarts == 0
        self.conclude(harness, listener)

    def test_an_announcer_restarted_after_a_crash_is_a_restart_and_no_conflict(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "detects_crash", "knows_incarnations")
        listener = Listener(harness).start()
        first = harness.announcer(mortal=True)
        first.announce(hint("engine", "first"))
        self.named(harness, listener, "engine", "first")
        harness.crash(first)
        self.reaches(harness, listener, "engine", Status.STALE)
        harness.announcer().announce(hint("engine", "second"))
        self.active(harness, listener, "engine")
        stored = known(listener, "engine")
        assert stored.hint.display_name == "second"
        assert stored.restarts == 1
        assert not stored.conflict
        self.conclude(harness, listener)

    def test_a_crash_noticed_late_does_not_harm_the_successor(self, harness: Harness) -> None:
        self.needs(harness, "knows_incarnations")
        listener = Listener(harness).start()
        first = harness.announcer(mortal=True)
        first.announce(hint("engine", "first"))
        self.named(harness, listener, "engine", "first")
        with harness.silenced(first):
            second = harness.announcer()
            second.announce(hint("engine", "second"))
            self.named(harness, listener, "engine", "second")
            harness.crash(first)
        self.never(harness, lambda: not listener.has("engine"), "the successor is not active")
        assert not known(listener, "engine").conflict
        self.conclude(harness, listener)

    def test_an_announcer_restarted_after_a_goodbye_begins_an_empty_life(
        self, harness: Harness
    ) -> None:
        self.needs(harness, "has_goodbye", "knows_incarnations")
        listener = Listener(harness).start()
        first = harness.announcer()
        first.announce(hint("engine", "first"))
        self.active(harness, listener, "engine")
        first.close()
        self.reaches(harness, listener, "engine", Status.LEFT)
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")
        stored = known(listener, "engine")
        assert not stored.hint.display_name
        assert stored.restarts == 1
        assert not stored.conflict
        self.conclude(harness, listener)
