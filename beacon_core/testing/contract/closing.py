"""Closing: once, twice, early, late, from anywhere; silence ever after; and health throughout."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import attrs
import cattrs
import pytest

from beacon_core.errors import ConfigError, UsageError
from beacon_core.ports.health import Condition, Health
from beacon_core.testing.contract.base import ContractBase, hint
from beacon_core.testing.harness import CLOSE_WITHIN_S, Harness, Listener, within

__all__ = ["ClosingChecks"]


class ClosingChecks(ContractBase):
    """What the ports say of ``start``, ``close``, ``health`` and options."""

    # Sources

    def test_nothing_is_heard_before_start(self, harness: Harness) -> None:
        listener = Listener(harness)
        harness.announcer().announce(hint("engine"))
        self.never(harness, lambda: bool(listener.tap.calls), "a call before start")

    def test_nothing_is_heard_after_close(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        within(CLOSE_WITHIN_S, listener.source.close)
        heard = len(listener.tap.calls)
        announcer.announce(hint("engine", "again"))
        announcer.close()
        self.never(harness, lambda: len(listener.tap.calls) > heard, "a call after close")

    def test_a_source_closes_in_the_middle_of_traffic(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        for number in range(5):
            harness.announcer(period_s=0.01).announce(hint(f"robot-{number}"))
        self.eventually(harness, lambda: len(listener.tap.calls) >= 25, "traffic flows")
        within(CLOSE_WITHIN_S, listener.source.close)
        heard = len(listener.tap.calls)
        self.never(harness, lambda: len(listener.tap.calls) > heard, "a call after close")

    def test_a_source_closes_twice(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        within(CLOSE_WITHIN_S, listener.source.close)
        within(CLOSE_WITHIN_S, listener.source.close)

    def test_a_source_closes_from_two_threads_at_once(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")

        def close_from_both() -> None:
            other = threading.Thread(target=listener.source.close, daemon=True)
            other.start()
            listener.source.close()
            other.join()

        within(2 * CLOSE_WITHIN_S, close_from_both)
        assert listener.source.health().condition is Condition.CLOSED

    def test_a_source_closes_before_it_started_and_stays_closed(self, harness: Harness) -> None:
        listener = Listener(harness)
        within(CLOSE_WITHIN_S, listener.source.close)
        with pytest.raises(UsageError):
            listener.start()
        harness.announcer().announce(hint("engine"))
        self.never(harness, lambda: bool(listener.tap.calls), "a call after close")

    def test_a_source_closes_from_inside_a_callback(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        closed: list[int] = []

        def close() -> None:
            if not closed:
                listener.source.close()
                closed.append(1)

        listener.tap.hook = close
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        within(
            harness.patience_s + CLOSE_WITHIN_S,
            lambda: self.eventually(harness, lambda: bool(closed), "closed from the callback"),
        )
        self.eventually(harness, lambda: len(listener.tap.calls) == 1, "the callback ends")
        announcer.announce(hint("engine", "again"))
        self.never(harness, lambda: len(listener.tap.calls) > 1, "a call after close")

    def test_close_waits_for_the_callback_in_progress(self, harness: Harness) -> None:
        for _ in range(5):
            order, held_s = self._close_during_a_callback(harness)
            # A close may give up after half of its time, for which a busy machine may hold us up.
            if held_s < 0.35 * CLOSE_WITHIN_S:
                break
        assert order == ["callback ended", "close returned"]

    def _close_during_a_callback(self, harness: Harness) -> tuple[list[str], float]:
        """What ended in which order, and for how many seconds the callback was held."""
        listener = Listener(harness).start()
        entered, release = threading.Event(), threading.Event()
        order: list[str] = []
        began: list[float] = []

        def hold() -> None:
            began.append(time.monotonic())
            entered.set()
            release.wait(CLOSE_WITHIN_S)
            order.append("callback ended")

        def close() -> None:
            listener.source.close()
            order.append("close returned")

        listener.tap.hook = hold
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        waiting = threading.Thread(
            target=harness.wait_until, args=(release.is_set, harness.patience_s), daemon=True
        )
        waiting.start()
        assert entered.wait(10.0), "the callback is never called"
        closing = threading.Thread(target=close, daemon=True)
        closing.start()
        closing.join(0.2)
        release.set()
        held_s = time.monotonic() - began[0]
        within(CLOSE_WITHIN_S, closing.join)
        within(harness.patience_s, waiting.join)
        announcer.close()
        return order, held_s

    def test_a_second_start_is_a_mistake_of_the_caller(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        with pytest.raises(UsageError):
            listener.start()
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")

    # Announcers

    def test_an_announcer_closes_in_the_middle_of_traffic_and_is_silent(
        self, harness: Harness
    ) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer(period_s=0.01)
        for number in range(5):
            announcer.announce(hint(f"part-{number}"))
        self.eventually(harness, lambda: len(listener.tap.calls) >= 25, "traffic flows")
        within(CLOSE_WITHIN_S, announcer.close)
        marker = harness.announcer()
        marker.announce(hint("marker"))
        self.active(harness, listener, "marker")
        harness.wait_until(lambda: False, harness.quiet_s)

        def words() -> int:
            return sum(call.outcome.entity_id != "marker" for call in listener.tap.calls)

        heard = words()
        self.never(harness, lambda: words() > heard, "a word after close")

    def test_an_announcer_closes_twice(self, harness: Harness) -> None:
        announcer = harness.announcer(period_s=0.01)
        announcer.announce(hint("engine"))
        within(CLOSE_WITHIN_S, announcer.close)
        within(CLOSE_WITHIN_S, announcer.close)

    def test_announcing_after_close_is_a_mistake_of_the_caller(self, harness: Harness) -> None:
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        announcer.close()
        with pytest.raises(UsageError):
            announcer.announce(hint("engine"))
        announcer.withdraw("engine")

    # Health

    def test_health_before_start_while_up_and_after_close(self, harness: Harness) -> None:
        listener = Listener(harness)
        assert listener.source.health().condition is Condition.STARTING
        listener.start()
        self.eventually(
            harness, lambda: listener.source.health().condition is Condition.UP, "the source is up"
        )
        assert not listener.source.health().detail
        listener.source.close()
        assert listener.source.health().condition is Condition.CLOSED

    def test_health_never_raises_whatever_else_is_going_on(self, harness: Harness) -> None:
        listener = Listener(harness)
        with _asked_all_the_time(listener.source.health) as ask:
            ask()
            listener.start()
            ask()
            harness.announcer().announce(hint("engine"))
            self.active(harness, listener, "engine")
            listener.source.close()
            ask()

    def test_an_announcers_health_while_up_and_after_close(self, harness: Harness) -> None:
        Listener(harness).start()
        announcer = harness.announcer()
        self.eventually(
            harness, lambda: announcer.health().condition is Condition.UP, "the announcer is up"
        )
        assert not announcer.health().detail
        announcer.close()
        assert announcer.health().condition is Condition.CLOSED

    def test_an_announcers_health_never_raises_whatever_else_is_going_on(
        self, harness: Harness
    ) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer(period_s=0.01)
        with _asked_all_the_time(announcer.health) as ask:
            ask()
            announcer.announce(hint("engine"))
            announcer.announce(hint("brake"))
            self.active(harness, listener, "engine", "brake")
            announcer.withdraw("engine")
            ask()
            announcer.close()
            ask()

    def test_health_counters_have_names_in_kebab_case(self, harness: Harness) -> None:
        listener, announcer = Listener(harness).start(), harness.announcer()
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        for health in (listener.source.health(), announcer.health()):
            for name, value in health.counters.items():
                assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name)
                assert isinstance(value, int)

    # Options

    def test_options_are_plain_data_for_cattrs(self, harness: Harness) -> None:
        options, converter = harness.options(), cattrs.Converter(forbid_extra_keys=True)
        assert attrs.has(harness.adapter.options)
        assert isinstance(options, harness.adapter.options)
        plain = converter.unstructure(options)
        assert converter.structure(plain, harness.adapter.options) == options

    def test_an_unknown_option_is_refused(self, harness: Harness) -> None:
        converter = cattrs.Converter(forbid_extra_keys=True)
        plain = converter.unstructure(harness.options()) | {"no_such_option": 1}
        with pytest.raises(cattrs.ClassValidationError):
            converter.structure(plain, harness.adapter.options)

    def test_an_option_with_a_wrong_value_is_refused_by_name(self, harness: Harness) -> None:
        assert harness.bad_options, "the harness names none: every adapter has a wrong value"
        for bad in harness.bad_options:
            with pytest.raises(ConfigError) as refusal:
                harness.adapter.options(**bad)
            assert any(key in str(refusal.value) for key in bad)


@contextmanager
def _asked_all_the_time(health: Callable[[], Health]) -> Iterator[Callable[[], Health]]:
    """Within, a thread asks without a pause, and the block may ask too; nothing may be raised."""
    failures: list[Exception] = []
    done = threading.Event()

    def keep_asking() -> None:
        try:
            while not done.is_set():
                health()
        except Exception as failure:  # noqa: BLE001 - it is shown below
            failures.append(failure)

    asking = threading.Thread(target=keep_asking, daemon=True)
    asking.start()
    try:
        yield health
    finally:
        done.set()
    within(CLOSE_WITHIN_S, asking.join)
    assert not failures
