"""Starting, closing, health, options: the checks pass for the fake, and each tells of its fault."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_core.testing.contract.closing import ClosingChecks
from beacon_core.testing.harness import Harness
from beacon_fake import (
    ADAPTER,
    FakeAnnouncer,
    FakeNetwork,
    FakeSource,
)
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]


class TestClosing(ClosingChecks):
    def make_harness(self) -> Harness:
        return FakeHarness()


class Broken(Exception):  # noqa: N818 - it is the fault, not an error of the test
    """What a broken adapter raises where it must not."""


class HearsBeforeStart(FakeSource):
    def __init__(self, network: FakeNetwork, name: str = "") -> None:
        super().__init__(network, name)
        network.join_receiver(self)

    def start(self, sink: HintSink) -> None:
        self._sink = sink


class IgnoresClose(FakeSource):
    def close(self) -> None:
        pass


class ClosesOnce(FakeSource):
    def close(self) -> None:
        if self._closed:
            raise Broken
        super().close()


class ClosesSlowly(FakeSource):
    def close(self) -> None:
        threading.Event().wait(1.5)
        super().close()


class CannotCloseFromACallback(FakeSource):
    def close(self) -> None:
        if self._caller == threading.get_ident():
            threading.Event().wait(10.0)
        super().close()


def cannot_close_from_a_callback() -> FakeHarness:
    harness = FakeHarness(source=CannotCloseFromACallback)
    harness.patience_s = 1.0
    return harness


class DoesNotWaitForTheCallback(FakeSource):
    def close(self) -> None:
        self._closed = True
        self._network.leave(self)


class StartsTwice(FakeSource):
    def start(self, sink: HintSink) -> None:
        if self._sink is None:
            super().start(sink)


class StartsAfterClose(FakeSource):
    def start(self, sink: HintSink) -> None:
        self._closed = False
        super().start(sink)


class AnnouncesAfterClose(FakeAnnouncer):
    def announce(self, hint: BeaconHint) -> None:
        if not self._gone:
            super().announce(hint)


class RepeatsAfterClose(FakeAnnouncer):
    def close(self) -> None:
        self._network.leave(self)


class AnnouncerClosesOnce(FakeAnnouncer):
    def close(self) -> None:
        if self._gone:
            raise Broken
        super().close()


class HealthNeedsAStart(FakeSource):
    def health(self) -> Health:
        assert self._sink is not None
        return super().health()


class HealthNeedsAnOpenSource(FakeSource):
    def health(self) -> Health:
        if self._closed:
            raise Broken
        return super().health()


class NamesCountersInItsOwnWay(FakeSource):
    def health(self) -> Health:
        return attrs.evolve(super().health(), counters={"callsSoFar": 1})


class AnnouncerNamesCountersInItsOwnWay(FakeAnnouncer):
    def health(self) -> Health:
        return attrs.evolve(super().health(), counters={"Entities": 1})


class AnnouncerIsNeverUp(FakeAnnouncer):
    def health(self) -> Health:
        return Health(Condition.STARTING)


class AnnouncerComplainsThoughItIsUp(FakeAnnouncer):
    def health(self) -> Health:
        return attrs.evolve(super().health(), detail="all is well")


class AnnouncerIsUpForEver(FakeAnnouncer):
    def health(self) -> Health:
        return Health(Condition.UP)


class HealthNeedsAnOpenAnnouncer(FakeAnnouncer):
    def health(self) -> Health:
        if self._gone:
            raise Broken
        return super().health()


class HealthNeedsAnAnnouncerThatIsNotClosing(FakeAnnouncer):
    def __init__(self, network: FakeNetwork, *, period_s: float | None = None) -> None:
        super().__init__(network, period_s=period_s)
        self.closing, self.asked = threading.Event(), threading.Event()

    def close(self) -> None:
        self.closing.set()
        self.asked.wait(0.9)
        self.closing.clear()
        super().close()

    def health(self) -> Health:
        if self.closing.is_set():
            self.asked.set()
            raise Broken
        return super().health()


@attrs.frozen
class CarelessOptions:
    network: object = "default"
    name: object = ""
    clock_offset_s: object = 0.0


def takes_any_option() -> FakeHarness:
    harness = FakeHarness()
    harness.adapter = attrs.evolve(ADAPTER, options=CarelessOptions)
    return harness


BROKEN: list[tuple[Callable[[], FakeHarness], str, dict[str, Any]]] = [
    (
        lambda: FakeHarness(source=HearsBeforeStart),
        "a_source_closes_before_it_started_and_stays_closed",
        {},
    ),
    (lambda: FakeHarness(source=IgnoresClose), "nothing_is_heard_after_close", {}),
    (lambda: FakeHarness(source=IgnoresClose), "a_source_closes_in_the_middle_of_traffic", {}),
    (lambda: FakeHarness(source=ClosesOnce), "a_source_closes_twice", {}),
    (lambda: FakeHarness(source=ClosesOnce), "a_source_closes_from_two_threads_at_once", {}),
    (lambda: FakeHarness(source=ClosesSlowly), "nothing_is_heard_after_close", {}),
    (cannot_close_from_a_callback, "a_source_closes_from_inside_a_callback", {}),
    (
        lambda: FakeHarness(source=DoesNotWaitForTheCallback),
        "close_waits_for_the_callback_in_progress",
        {},
    ),
    (lambda: FakeHarness(source=StartsTwice), "a_second_start_is_a_mistake_of_the_caller", {}),
    (
        lambda: FakeHarness(source=StartsAfterClose),
        "a_source_closes_before_it_started_and_stays_closed",
        {},
    ),
    (
        lambda: FakeHarness(announcer=AnnouncesAfterClose),
        "announcing_after_close_is_a_mistake_of_the_caller",
        {},
    ),
    (
        lambda: FakeHarness(announcer=RepeatsAfterClose),
        "an_announcer_closes_in_the_middle_of_traffic_and_is_silent",
        {},
    ),
    (lambda: FakeHarness(announcer=AnnouncerClosesOnce), "an_announcer_closes_twice", {}),
    (
        lambda: FakeHarness(source=HealthNeedsAStart),
        "health_before_start_while_up_and_after_close",
        {},
    ),
    (
        lambda: FakeHarness(source=HealthNeedsAnOpenSource),
        "health_before_start_while_up_and_after_close",
        {},
    ),
    (
        lambda: FakeHarness(source=NamesCountersInItsOwnWay),
        "health_counters_have_names_in_kebab_case",
        {},
    ),
    (
        lambda: FakeHarness(announcer=AnnouncerNamesCountersInItsOwnWay),
        "health_counters_have_names_in_kebab_case",
        {},
    ),
    (
        lambda: FakeHarness(announcer=AnnouncerIsNeverUp),
        "an_announcers_health_while_up_and_after_close",
        {},
    ),
    (
        lambda: FakeHarness(announcer=AnnouncerComplainsThoughItIsUp),
        "an_announcers_health_while_up_and_after_close",
        {},
    ),
    (
        lambda: FakeHarness(announcer=AnnouncerIsUpForEver),
        "an_announcers_health_while_up_and_after_close",
        {},
    ),
    (
        lambda: FakeHarness(announcer=HealthNeedsAnOpenAnnouncer),
        "an_announcers_health_never_raises_whatever_else_is_going_on",
        {},
    ),
    (
        lambda: FakeHarness(announcer=HealthNeedsAnAnnouncerThatIsNotClosing),
        "an_announcers_health_never_raises_whatever_else_is_going_on",
        {},
    ),
    (takes_any_option, "an_option_with_a_wrong_value_is_refused_by_name", {}),
    (
        lambda: FakeHarness(source=HealthNeedsAnOpenSource),
        "health_never_raises_whatever_else_is_going_on",
        {},
    ),
    (
        lambda: FakeHarness(source=IgnoresClose),
        "a_source_closes_from_inside_a_callback",
        {},
    ),
]


@pytest.mark.parametrize(("broken", "check", "parameters"), BROKEN)
def test_the_suite_reports_the_fault(
    run: Run, broken: Callable[[], FakeHarness], check: str, parameters: dict[str, Any]
) -> None:
    with pytest.raises((AssertionError, pytest.fail.Exception, Broken)):
        run(f"test_{check}", broken(), **parameters)
