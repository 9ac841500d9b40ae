"""The plan of who is asked when: cycles, slots, turns, back-off, nudges, and what it costs."""

from __future__ import annotations

import math
import time
from typing import Any

import attrs
import pytest

from beacon_core.errors import ConfigError
from beacon_core.poller import PollPlan, PollStats

S = 1_000_000_000
ZERO = 1_000 * S
"""When the plan is made. Times below are seconds after it."""


class Poller:
    """A plan with its clock, and a short way to speak to it."""

    def __init__(self, *targets: str, **config: Any) -> None:
        self.now_s = 0.0
        self.plan = PollPlan(now_ns=ZERO, **config)
        self.targets(*targets)

    @property
    def now(self) -> int:
        return ZERO + round(self.now_s * S)

    def at(self, now_s: float) -> Poller:
        self.now_s = now_s
        return self

    def targets(self, *names: str) -> None:
        self.plan.set_targets(names, self.now)

    def begin(self) -> str:
        """The names are single letters."""
        return "".join(self.plan.begin(self.now))

    def overdue(self) -> str:
        return "".join(self.plan.overdue(self.now))

    def forgotten(self) -> str:
        return "".join(self.plan.forgotten(self.now))

    def answered(self, *names: str) -> None:
        for name in names:
            self.plan.answered(name, self.now)

    def failed(self, *names: str) -> None:
        for name in names:
            self.plan.failed(name, self.now)

    def nudge(self, *names: str) -> None:
        for name in names:
            self.plan.nudge(name, self.now)

    def ask(self) -> str:
        """Begin, and have all answered at once, until there is nobody more to ask."""
        asked = ""
        while begun := self.begin():
            self.answered(*begun)
            asked += begun
        return asked

    @property
    def due_s(self) -> float:
        return (self.plan.next_due_ns() - ZERO) / S

    @property
    def stats(self) -> PollStats:
        return self.plan.stats()


# -- cycles --------------------------------------------------------------------------------------


def test_all_are_asked_at_once_and_again_each_interval() -> None:
    poller = Poller("a", "b", "c")
    assert poller.ask() == "abc"
    assert poller.due_s == 5
    assert poller.at(4.999_999_999).ask() == ""
    assert poller.at(5).ask() == "abc"
    assert poller.at(10).ask() == "abc"
    assert poller.stats.cycles == 3


def test_a_cycle_that_began_late_is_followed_an_interval_later_and_none_is_made_up_for() -> None:
    poller = Poller("a")
    poller.ask()
    assert poller.at(3600).ask() == "a"
    assert poller.ask() == ""
    assert poller.due_s == 3605


def test_a_plan_without_targets_keeps_its_cycles() -> None:
    poller = Poller()
    assert poller.due_s == 0
    assert (poller.begin(), poller.due_s) == ("", 5)
    assert poller.stats.cycles == 1


def test_time_that_goes_back_is_no_time() -> None:
    poller = Poller("a", interval_s=1)
    assert poller.at(10).ask() == "a"
    assert poller.at(5).ask() == ""
    assert poller.due_s == 11
    poller.targets("b")
    assert poller.at(11).begin() == "b"


def test_a_cycle_lasts_longer_than_the_interval_while_a_proven_node_waits() -> None:
    poller = Poller("a", "b", "c", interval_s=1, max_in_flight=1)
    assert poller.ask() == "abc"
    assert poller.at(1).begin() == "a"
    poller.at(2.5)
    assert (poller.begin(), poller.due_s) == ("", 3)
    assert (poller.at(3).overdue(), poller.begin()) == ("a", "b")
    poller.at(3.5).answered("b")
    assert poller.stats.cycles == 2
    assert poller.begin() == "c"
    poller.at(3.6).answered("c")
    assert poller.due_s == 2
    assert poller.begin() == "b"
    assert (poller.stats.cycles, poller.stats.cut_cycles) == (3, 0)


def test_who_is_in_flight_when_a_cycle_starts_is_asked_in_it_when_it_has_answered() -> None:
    poller = Poller("a", "b", interval_s=1)
    assert poller.begin() == "ab"
    poller.answered("b")
    assert poller.at(1).begin() == "b"
    poller.at(1.5).answered("a")
    assert poller.begin() == "a"
    poller.at(1.6).answered("a")
    assert poller.begin() == ""


# -- slots, deadlines ----------------------------------------------------------------------------


def test_no_more_are_in_flight_than_there_are_slots() -> None:
    poller = Poller(*"abcdef", max_in_flight=2)
    assert poller.begin() == "ab"
    assert (poller.begin(), poller.plan.in_flight) == ("", 2)
    poller.failed("b")
    assert poller.begin() == "c"
    poller.failed("a")
    assert poller.begin() == "d"
    assert (poller.at(2).overdue(), poller.plan.in_flight) == ("cd", 0)
    assert poller.begin() == "ef"
    poller.answered("e", "f")
    assert poller.at(5).begin() == "ef"
    poller.answered("e")
    assert (poller.plan.in_flight, poller.begin()) == (1, "")


def test_each_poll_has_its_own_deadline() -> None:
    poller = Poller("a", "b", max_in_flight=1)
    assert poller.begin() == "a"
    poller.at(0.5).answered("a")
    assert poller.begin() == "b"
    assert poller.due_s == 2.5
    assert poller.at(2.499_999_999).overdue() == ""
    assert poller.at(2.5).overdue() == "b"
    assert poller.overdue() == ""


def test_an_answer_that_comes_before_anybody_looked_at_the_deadline_counts() -> None:
    poller = Poller("a")
    poller.begin()
    poller.at(3).answered("a")
    assert poller.overdue() == ""
    assert poller.stats.failures == 0


@pytest.mark.parametrize("late", ["answered", "failed"])
def test_what_comes_of_a_node_that_is_not_in_flight_is_ignored(late: str) -> None:
    poller = Poller("a")
    poller.begin()
    assert poller.at(2).overdue() == "a"
    before = poller.stats
    getattr(poller, late)("a", "nobody")
    assert poller.stats == before
    assert (poller.at(5).begin(), poller.at(10).begin()) == ("", "a")


# -- the order rotates ---------------------------------------------------------------------------


def test_a_cycle_that_is_cut_is_continued_by_the_next_one() -> None:
    poller = Poller(*"abcde", interval_s=5, budget_s=1, max_in_flight=1)
    poller.ask()
    order = ""
    for second in (5, 10, 15, 20):
        for later in (0, 0.4, 0.8, 1.0):
            begun = poller.at(second + later).begin()
            poller.at(second + later + 0.3).answered(*begun)
            order += begun
    assert order == "abcdeabcdeab"
    assert (poller.stats.cycles, poller.stats.cut_cycles) == (5, 3)
    poller.at(25).begin()
    assert poller.stats.cut_cycles == 4


def test_nothing_begins_once_the_budget_is_spent_and_that_is_waited_for() -> None:
    poller = Poller("a", "b", "c", interval_s=5, budget_s=2, max_in_flight=1)
    poller.ask()
    assert poller.at(5).begin() == "a"
    poller.at(6.999_999_999).answered("a")
    assert poller.plan.next_due_ns() == poller.now
    assert poller.begin() == "b"
    poller.at(7).answered("b")
    assert (poller.begin(), poller.due_s) == ("", 10)
    assert poller.at(10).begin() == "c"


def test_a_budget_longer_than_the_interval_ends_a_cycle_that_does_not_get_through() -> None:
    poller = Poller("a", "b", "c", interval_s=1, budget_s=3, timeout_s=60, max_in_flight=1)
    poller.ask()
    assert poller.at(1).begin() == "a"
    assert poller.due_s == 4
    assert (poller.at(4).begin(), poller.due_s) == ("", 7)
    assert (poller.stats.cycles, poller.stats.cut_cycles) == (3, 1)
    poller.answered("a")
    assert poller.ask() == "bca"


def test_a_cycle_that_ends_with_everybody_asked_is_not_cut() -> None:
    poller = Poller("a", interval_s=5, budget_s=1)
    poller.begin()
    poller.at(1.5).answered("a")
    assert poller.at(5).begin() == "a"
    assert poller.stats.cut_cycles == 0


def test_the_first_cycle_cuts_none() -> None:
    poller = Poller("a", interval_s=5, budget_s=1)
    assert poller.at(5).ask() == "a"
    assert poller.stats.cut_cycles == 0


# -- back-off ------------------------------------------------------------------------------------


def cycles_asked(poller: Poller, end: str, cycles: int) -> list[int]:
    """The cycles in which ``a`` was asked, if each of its polls ends this way."""
    asked = []
    for cycle in range(cycles):
        poller.at(5 * cycle)
        if poller.begin():
            asked.append(cycle)
            if end == "overdue":
                poller.at(5 * cycle + 2).overdue()
            else:
                poller.failed("a")
    return asked


@pytest.mark.parametrize("end", ["overdue", "failed"])
def test_a_node_that_fails_is_skipped_for_1_2_4_8_8_cycles(end: str) -> None:
    assert cycles_asked(Poller("a"), end, 45) == [0, 2, 5, 10, 19, 28, 37]


def test_the_cycles_after_the_one_in_which_it_failed_count() -> None:
    poller = Poller("a", interval_s=1, timeout_s=2.5)
    assert poller.begin() == "a"
    poller.at(1).begin()
    poller.at(2).begin()
    assert poller.at(2.5).overdue() == "a"
    assert [poller.at(second).begin() for second in (2.5, 3, 4)] == ["", "", "a"]


def test_success_resets_the_back_off() -> None:
    poller = Poller("a")
    assert cycles_asked(poller, "failed", 20) == [0, 2, 5, 10, 19]
    assert poller.stats.backing_off == 1
    assert poller.at(5 * 28).ask() == ""
    poller.nudge("a")
    assert poller.ask() == "a"
    assert poller.stats.backing_off == 0
    assert poller.at(5 * 29).begin() == "a"
    poller.failed("a")
    assert [poller.at(5 * cycle).begin() for cycle in (30, 31)] == ["", "a"]


def test_a_node_that_came_back_is_asked_at_once_and_its_back_off_begins_anew() -> None:
    poller = Poller("a")
    assert cycles_asked(poller, "failed", 20) == [0, 2, 5, 10, 19]
    poller.targets()
    assert poller.stats.backing_off == 0
    poller.targets("a")
    assert poller.begin() == "a"
    poller.failed("a")
    assert [poller.at(5 * cycle).begin() for cycle in (20, 21)] == ["", "a"]


# -- who hangs does not hold up who answers ------------------------------------------------------


def test_silent_nodes_leave_half_of_the_slots_to_proven_ones() -> None:
    poller = Poller(*"ABCDEFwxyz", interval_s=5, max_in_flight=5)
    poller.begin()
    poller.failed(*"ABCDE")
    assert poller.begin() == "Fwxyz"
    poller.failed("F")
    poller.answered(*"wxyz")
    assert poller.at(5).ask() == "wxyz"
    assert (poller.at(10).begin(), poller.begin()) == ("AwBxy", "")
    poller.answered(*"wxy")
    assert poller.begin() == "z"
    assert (poller.at(12).overdue(), poller.begin()) == ("ABz", "CD")


def test_of_fewer_proven_nodes_than_half_the_slots_each_has_its_own() -> None:
    poller = Poller(*"abcdefx", max_in_flight=6)
    assert poller.begin() == "abcdef"
    poller.failed("a")
    assert poller.begin() == "x"
    poller.answered("x")
    assert poller.begin() == ""
    poller.at(2).overdue()
    assert poller.at(5).ask() == "x"
    assert poller.at(10).begin() == "axbcde"
    poller.answered("x")
    assert poller.begin() == ""
    assert (poller.at(12).overdue(), poller.begin()) == ("abcde", "f")


def test_at_the_start_newcomers_have_all_slots() -> None:
    assert Poller(*"abcdef", max_in_flight=4).begin() == "abcd"


def test_newcomers_silent_and_proven_ones_take_turns_for_a_single_slot() -> None:
    poller = Poller(*"ABxyz", interval_s=10, max_in_flight=1)
    for name in "AB":
        assert poller.begin() == name
        poller.failed(name)
    assert poller.ask() == "xyz"
    assert poller.at(10).ask() == "xyz"
    poller.at(20).targets(*"ABxyzmn")
    order = ""
    for second in range(20, 34, 2):
        order += poller.at(second).begin()
        poller.overdue()
        poller.at(second + 2).overdue()
    assert order == "mAxnByz"


def test_silent_nodes_that_wait_do_not_hold_up_the_cycle() -> None:
    poller = Poller(*"ABCDx", interval_s=5, max_in_flight=2, timeout_s=4)
    poller.begin()
    poller.failed("A", "B")
    poller.begin()
    poller.failed("C", "D")
    assert poller.ask() == "x"
    assert poller.at(5).ask() == "x"
    assert poller.at(10).begin() == "Ax"
    poller.answered("x")
    assert (poller.at(14).overdue(), poller.begin()) == ("A", "B")
    assert poller.at(15).ask() == "x"
    assert (poller.at(18).overdue(), poller.begin()) == ("B", "C")
    assert poller.at(20).ask() == "x"
    assert (poller.at(22).overdue(), poller.begin()) == ("C", "D")
    assert (poller.stats.cycles, poller.stats.cut_cycles) == (5, 0)


def test_a_mass_hang_at_the_worst_moment_costs_a_live_node_nothing_while_one_slot_is_left() -> None:
    names = [f"n{number}" for number in range(200)]
    plan = PollPlan(now_ns=0)
    plan.set_targets(names, 0)
    live = names[-73:]
    for name in _answer_all(plan, names, 0):
        assert name in names
    begun = _answer_all(plan, live, 5 * S)
    assert set(live) <= set(begun)
    assert plan.in_flight == 127


def _answer_all(plan: PollPlan, live: list[str], now_ns: int) -> list[str]:
    asked = []
    while begun := plan.begin(now_ns):
        asked += begun
        for name in begun:
            if name in live:
                plan.answered(name, now_ns)
    return asked


# -- nodes come and go ---------------------------------------------------------------------------


def test_a_newcomer_is_asked_in_the_running_cycle() -> None:
    poller = Poller("a")
    poller.ask()
    poller.at(1).targets("a", "b")
    assert poller.due_s == 1
    assert poller.ask() == "b"
    assert poller.at(5).ask() == "ab"


def test_a_newcomer_waits_for_the_next_cycle_if_the_budget_is_spent() -> None:
    poller = Poller("a", budget_s=1)
    poller.ask()
    poller.at(1).targets("a", "b")
    assert (poller.begin(), poller.due_s) == ("", 5)
    assert poller.at(5).ask() == "ab"
    assert poller.stats.cut_cycles == 1


def test_a_target_that_is_named_twice_is_one() -> None:
    assert Poller("a", "b", "a").begin() == "ab"


def test_one_that_vanished_is_not_asked_any_more() -> None:
    poller = Poller("a", "b", "c", max_in_flight=1)
    poller.begin()
    poller.targets("a", "c")
    poller.answered("a")
    assert poller.ask() == "c"
    poller.targets("c")
    assert poller.at(5).ask() == "c"


def test_the_poll_of_one_that_vanished_is_overdue_at_once_and_no_failure() -> None:
    poller = Poller("a", "b", max_in_flight=1)
    poller.begin()
    poller.at(1).targets("b")
    assert (poller.due_s, poller.plan.in_flight) == (1, 1)
    assert (poller.overdue(), poller.plan.in_flight) == ("a", 0)
    assert poller.begin() == "b"
    assert poller.stats.failures == 0


def test_it_is_overdue_before_the_ones_that_are_still_there() -> None:
    poller = Poller("a", "b")
    poller.begin()
    poller.at(1).targets("a")
    assert poller.overdue() == "b"
    assert poller.at(2).overdue() == "a"


@pytest.mark.parametrize("end", ["answered", "failed"])
def test_an_answer_of_its_last_life_proves_nothing(end: str) -> None:
    poller = Poller("a", "b", max_in_flight=1)
    poller.begin()
    poller.targets("b")
    getattr(poller, end)("a")
    assert (poller.overdue(), poller.plan.in_flight) == ("", 0)
    poller.targets("a", "b")
    assert poller.ask() == "ba"
    assert poller.stats.failures == 0


def test_one_that_came_back_is_asked_when_its_old_request_has_come_down() -> None:
    poller = Poller("a", "b")
    poller.begin()
    poller.targets("b")
    poller.targets("a", "b")
    assert poller.begin() == ""
    assert poller.overdue() == "a"
    assert poller.begin() == "a"


def test_one_that_came_back_and_vanished_again_is_gone() -> None:
    poller = Poller("a")
    poller.begin()
    poller.targets()
    poller.targets("a")
    poller.targets()
    assert poller.overdue() == "a"
    assert (poller.begin(), poller.stats.targets) == ("", 0)


def test_a_proven_node_that_vanished_leaves_its_slot_to_others() -> None:
    poller = Poller("x", max_in_flight=2)
    poller.ask()
    poller.targets(*"xab")
    assert poller.begin() == "a"
    poller.targets(*"ab")
    assert poller.begin() == "b"


def test_vanished_ones_are_forgotten_once_after_their_time() -> None:
    poller = Poller("a", "b", "c", forget_after_s=60)
    poller.ask()
    poller.at(1).targets("c")
    poller.at(2).targets()
    assert poller.at(60.999_999_999).forgotten() == ""
    poller.begin()
    assert poller.due_s == 61
    assert poller.at(61).forgotten() == "ab"
    poller.begin()
    assert poller.due_s == 62
    assert poller.at(62).forgotten() == "c"
    assert poller.at(1000).forgotten() == ""


def test_one_that_came_back_in_time_is_not_forgotten() -> None:
    poller = Poller("a")
    poller.targets()
    poller.at(59).targets("a")
    assert poller.at(61).forgotten() == ""
    poller.targets()
    assert poller.at(120.999_999_999).forgotten() == ""
    assert poller.at(121).forgotten() == "a"


def test_they_may_be_forgotten_at_once() -> None:
    poller = Poller("a", forget_after_s=0)
    poller.begin()
    poller.targets()
    assert poller.forgotten() == "a"
    assert poller.overdue() == "a"


# -- nudges --------------------------------------------------------------------------------------


def test_a_nudged_node_is_asked_ahead_of_its_turn() -> None:
    poller = Poller(*"abcd", max_in_flight=1)
    poller.nudge("c", "b", "c")
    assert poller.ask() == "cbad"


def test_a_nudged_node_is_asked_again_in_a_cycle_that_is_over() -> None:
    poller = Poller("a", "b")
    poller.ask()
    poller.at(1).nudge("b")
    assert poller.due_s == 1
    assert poller.ask() == "b"
    assert poller.due_s == 5
    assert poller.at(5).ask() == "ab"


def test_a_nudge_is_stronger_than_a_spent_budget() -> None:
    poller = Poller("a", "b", budget_s=1, max_in_flight=1)
    poller.begin()
    poller.at(1.5).answered("a")
    poller.nudge("b")
    assert poller.due_s == 1.5
    assert poller.begin() == "b"


def test_a_nudge_is_not_stronger_than_the_cap() -> None:
    poller = Poller("a", "b", "c", max_in_flight=1)
    poller.begin()
    poller.nudge("c")
    assert (poller.begin(), poller.due_s) == ("", 2)
    poller.answered("a")
    assert poller.begin() == "c"


def test_a_nudge_is_stronger_than_back_off_and_does_not_end_it() -> None:
    poller = Poller("a")
    assert cycles_asked(poller, "failed", 10) == [0, 2, 5]
    poller.nudge("a")
    assert poller.stats.backing_off == 0
    assert poller.begin() == "a"
    poller.failed("a")
    assert (poller.stats.backing_off, poller.begin()) == (1, "")
    # It is the fourth failure in a row, in cycle 9: it rests for 8.
    assert [poller.at(5 * cycle).begin() for cycle in range(10, 19)] == [*8 * [""], "a"]


@pytest.mark.parametrize("end", ["answered", "failed"])
def test_one_that_is_nudged_while_in_flight_is_asked_once_more_afterwards(end: str) -> None:
    poller = Poller("a")
    poller.begin()
    poller.nudge("a", "a")
    assert poller.begin() == ""
    getattr(poller, end)("a")
    assert poller.ask() == "a"
    assert poller.begin() == ""


def test_unknown_names_are_not_nudged() -> None:
    poller = Poller("a", "b")
    poller.targets("b")
    poller.nudge("a", "nobody")
    assert poller.ask() == "b"


def test_one_that_came_back_may_be_nudged_before_its_old_request_has_come_down() -> None:
    poller = Poller("a", "b", "c", max_in_flight=1)
    poller.begin()
    poller.targets("b", "c")
    poller.targets("b", "c", "a")
    poller.nudge("a")
    assert poller.overdue() == "a"
    assert poller.ask() == "abc"


# -- what it says of itself ----------------------------------------------------------------------


def test_the_stats_count() -> None:
    poller = Poller("a", "b", "c")
    assert poller.stats == PollStats(3, 0, 0, 0, 0, 0, 0, 0)
    poller.begin()
    poller.answered("a")
    poller.at(1).failed("b")
    assert poller.stats == PollStats(
        targets=3,
        in_flight=1,
        backing_off=1,
        cycles=1,
        polls=3,
        failures=1,
        last_cycle_ns=0,
        cut_cycles=0,
    )
    poller.at(2).overdue()
    assert poller.stats == PollStats(3, 0, 2, 1, 3, 2, 2 * S, 0)
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        poller.stats.targets = 1  # type: ignore[misc]


def test_a_cycle_takes_until_the_last_answer() -> None:
    poller = Poller("a", "b", max_in_flight=1)
    poller.begin()
    poller.at(0.25).answered("a")
    assert poller.stats.last_cycle_ns == 0
    poller.begin()
    poller.at(0.5).answered("b")
    assert poller.stats.last_cycle_ns == S // 2
    poller.at(3).nudge("a")
    poller.ask()
    assert poller.stats.last_cycle_ns == S // 2
    poller.at(5).begin()
    assert poller.stats.last_cycle_ns == S // 2


def test_a_cycle_that_the_next_one_catches_up_with_has_taken_all_its_time() -> None:
    poller = Poller("a", "b", interval_s=1)
    poller.begin()
    poller.answered("b")
    assert poller.at(1).begin() == "b"
    assert poller.stats.last_cycle_ns == S


def test_a_cycle_with_nobody_to_ask_takes_no_time() -> None:
    poller = Poller("a")
    poller.at(0.5).ask()
    poller.at(1).targets()
    poller.at(5.5).begin()
    assert poller.stats.last_cycle_ns == 0


# -- configuration -------------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["interval_s", "budget_s", "timeout_s"])
@pytest.mark.parametrize("seconds", [math.nan, math.inf, -1.0, 0.0, 0.099, 1e10])
def test_a_time_that_cannot_work_is_refused_by_name(key: str, seconds: float) -> None:
    with pytest.raises(ConfigError, match=f"^{key}: .* is not possible; give a number of seconds"):
        Poller(**{key: seconds})


@pytest.mark.parametrize("key", ["interval_s", "budget_s", "timeout_s"])
def test_a_tenth_of_a_second_is_enough(key: str) -> None:
    assert Poller("a", **{key: 0.1}).ask() == "a"


def test_the_message_says_what_would_be_right() -> None:
    message = r"^timeout_s: 0\.05 is not possible; give a number of seconds, at least 0\.1$"
    with pytest.raises(ConfigError, match=message):
        Poller(timeout_s=0.05)


@pytest.mark.parametrize("seconds", [math.nan, math.inf, -0.001])
def test_a_time_to_forget_that_cannot_work_is_refused(seconds: float) -> None:
    with pytest.raises(ConfigError, match=r"^forget_after_s: "):
        Poller(forget_after_s=seconds)


@pytest.mark.parametrize("cap", [0, -1, math.nan, math.inf])
def test_a_cap_that_lets_nobody_pass_is_refused(cap: float) -> None:
    with pytest.raises(ConfigError, match=r"^max_in_flight: "):
        Poller(max_in_flight=cap)


def test_the_defaults_are_those_of_the_system_before_it() -> None:
    poller = Poller(*(f"{number}" for number in range(200)))
    assert len(poller.plan.begin(poller.now)) == 128
    assert poller.due_s == 2
    assert len(poller.at(2).plan.overdue(poller.now)) == 128
    assert poller.plan.begin(poller.now) != []
    assert poller.at(9.999).due_s == 4


# -- cost and memory -----------------------------------------------------------------------------


def work(targets: int) -> float:
    """Seconds of two cycles and a little more, with as many nodes; half of them answer."""
    names = [f"/node_{number}" for number in range(targets)]
    began = time.process_time()
    plan = PollPlan(now_ns=0, budget_s=1e6)
    plan.set_targets(names, 0)
    plan.nudge(names[-1], 0)
    now_ns = 0
    while plan.stats().cycles < 4:
        for index, name in enumerate(plan.begin(now_ns)):
            if index % 2:
                plan.answered(name, now_ns)
        now_ns = max(now_ns, plan.next_due_ns())
        plan.overdue(now_ns)
    plan.set_targets(names[1::2], now_ns)
    assert len(plan.forgotten(now_ns + 60 * S)) == len(names[::2])
    return time.process_time() - began


def test_ten_times_the_nodes_cost_ten_times_as_much() -> None:
    # What is quadratic costs a hundred times as much. The least of some is hardly disturbed.
    few, many = min(work(1_000) for _ in range(3)), min(work(10_000) for _ in range(2))
    assert many < 30 * few


def test_nothing_is_kept_of_nodes_that_are_forgotten() -> None:
    poller = Poller(max_in_flight=4, forget_after_s=3)
    plan = poller.plan
    for second in range(200):
        poller.at(second).targets(*(f"{second}.{number}" for number in range(10)))
        plan.overdue(poller.now)
        plan.forgotten(poller.now)
        begun = plan.begin(poller.now)
        plan.failed(begun[0], poller.now)
        plan.nudge(begun[1], poller.now)
        assert len(plan._nodes) == 10
        assert len(plan._vanished) <= 3 * 10
        assert len(plan._flights) <= 4
        assert len(plan._resting) <= 9
        waiting = [plan._urgent, plan._asked, *plan._turns, *plan._resting.values()]
        assert sum(map(len, waiting)) + len(plan._flights) <= 10
