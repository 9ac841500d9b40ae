"""The plan of polls against everything at once: its rules written naively, and its promises.

One machine draws nodes that come, go, are restarted, hang, thaw, fail and answer late, nudges, few
slots, budgets that do not suffice, a machine that oversleeps. A driver carries the plan out as an
adapter would, and asks it only when ``next_due_ns`` says so or something has happened.

Beside it stand the rules, written with lists that are searched, and must say the same, word for
word. And what is promised is checked without them, on what is seen from outside alone: the cap, the
back-off, the bound on the gaps of a live node.

    BEACON_MACHINE_SEED=7 pytest tests/property/test_poller.py            another run than usual
"""

from __future__ import annotations

import copy
from collections.abc import Iterator

import attrs
import pytest
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from beacon_core.poller import PollPlan
from tests.property.naive_poller import Naive, Setup
from tests.property.running import run

RUNS, STEPS_PER_RUN = 120, 40
S = 1_000_000_000
NAMES = "abcdefgh"
LIVE, HUNG, FAILING, LATE = "live", "hung", "failing", "late"
LONG_AGO = -(10**18)

met: set[str] = set()
"""What has happened in some run, so that a machine that tests nothing is found out."""


# -- what is seen from outside -------------------------------------------------------------------


@attrs.define(eq=False)
class Seen:
    """What the driver knows of one name."""

    mode: str = LIVE
    live_since: int = 0
    not_live: int = LONG_AGO
    """When it was last seen not to be live."""
    there_since: int | None = None
    there: int = LONG_AGO
    """When it was last a target."""
    vanished: int | None = None
    proven: bool = False
    nudged: bool = False
    failures: int = 0
    failed_in: int = 0
    begun: int | None = None
    """When it was last asked in this life."""
    begun_in: int = 0
    live: bool = False
    """It was live when it was last asked, and has been ever since."""


@attrs.frozen
class Begun:
    at: int
    name: str
    proven: bool
    nudged: bool


class Watch:
    """The promises, on what is seen alone."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.seen = {name: Seen() for name in NAMES}
        self.air: dict[str, bool] = {}
        # In flight: whether it was proven when it was asked.
        self.log: list[Begun] = []
        self.arrivals: list[int] = []
        self.cycle_start = 0

    # -- what happens

    def targets(self, names: list[str], now: int) -> None:
        for name, one in self.seen.items():
            if name in names and one.there_since is None:
                self.seen[name] = attrs.evolve(
                    one, there_since=now, vanished=None, proven=False, nudged=False, failures=0
                )
                self.seen[name].begun, self.seen[name].live = None, False
                self.arrivals.append(now)
            elif name not in names and one.there_since is not None:
                one.there_since, one.there, one.vanished = None, now, now

    def begin(self, names: list[str], cycle: int, now: int) -> None:
        for name in names:
            one = self.seen[name]
            assert name not in self.air
            assert one.there_since is not None
            if one.failures and not one.nudged:
                assert cycle > one.failed_in + rest(one.failures)
            if not one.nudged:
                assert cycle > one.begun_in or one.begun is None
                assert now < self.cycle_start + self.setup.budget
            self.check_wait(name, now)
            self.air[name] = one.proven
            self.log.append(Begun(now, name, one.proven, one.nudged))
            one.begun, one.begun_in, one.nudged = now, cycle, False
            one.live = one.mode == LIVE
        assert len(self.air) <= self.setup.slots
        if len(self.air) < self.setup.slots:
            self.check_nobody_waits_in_vain(cycle, now)

    def land(self, name: str, cycle: int, *, answered: bool, ignored: bool) -> None:
        one = self.seen[name]
        del self.air[name]
        if not ignored:
            one.proven, one.failed_in = answered, cycle
            one.failures = 0 if answered else one.failures + 1
            met.add(f"failed {min(one.failures, 5)} times")

    def forgotten(self, names: list[str], now: int) -> None:
        due = {
            name
            for name, one in self.seen.items()
            if one.vanished is not None and one.vanished + self.setup.forget_after <= now
        }
        assert sorted(names) == sorted(due)
        for name in names:
            self.seen[name].vanished = None

    def behave(self, name: str, mode: str, now: int) -> None:
        one = self.seen[name]
        if (mode == LIVE) != (one.mode == LIVE):
            one.live_since, one.not_live, one.live = now, now, False
        one.mode = mode

    def overslept(self, now: int) -> None:
        """The driver was late: that is its own fault, and no gap to blame the plan for."""
        for one in self.seen.values():
            one.live_since, one.live = now, False

    # -- what is promised

    def check_nobody_waits_in_vain(self, cycle: int, now: int) -> None:
        """Who is due is not left out while there is a slot for it and a budget."""
        there = {name: one for name, one in self.seen.items() if one.there_since is not None}
        assert not any(one.nudged and name not in self.air for name, one in there.items())
        if now >= self.cycle_start + self.setup.budget:
            return
        slots = self.setup.slots
        kept = min(-(-slots // 2), sum(one.proven for one in there.values()))
        lane_is_full = list(self.air.values()).count(False) >= max(1, slots - kept)
        for name, one in there.items():
            if name not in self.air and not (lane_is_full and not one.proven):
                asked = one.begun is not None and one.begun_in == cycle
                assert asked or (one.failures and cycle <= one.failed_in + rest(one.failures))
        if lane_is_full:
            met.add("silent ones wait while slots are kept free")

    def check_wait(self, name: str, now: int) -> None:
        """No live node starves."""
        one = self.seen[name]
        if one.there_since is None or one.mode != LIVE:
            return
        if one.live and one.begun is not None:
            self.check_gap(name, one.begun, now)
        elif name not in self.air and not one.proven:
            since = max(one.there_since, one.live_since)
            nudges = sum(begun.nudged for begun in self.log if begun.at >= since)
            polls = 3 * (2 * len(NAMES) + 2 + self.count_arrivals(since)) + nudges
            assert now - since <= self.setup.longest_return(polls)

    def check_gap(self, name: str, then: int, now: int) -> None:
        # From when polls that were in flight when the cycle of that poll started may have begun.
        since = then - self.setup.longest_cycle - self.setup.timeout
        others = {
            n: one for n, one in self.seen.items() if n != name and self.was_there(one, since)
        }
        hung = {n for n, one in others.items() if one.mode != LIVE or one.not_live >= since}
        lately = [begun for begun in self.log if begun.at >= since]
        anew = sum(begun.proven and begun.name in hung for begun in lately)
        nudges = sum(begun.nudged for begun in lately)
        # Who comes anew may come between once more, if it answers: the lane is not full then.
        many = len(others) + self.count_arrivals(since)
        gap, bound = now - then, self.setup.largest_gap(many, len(hung), anew, nudges)
        assert gap <= bound, (name, gap, bound)
        if 2 * gap > bound:
            met.add("a gap of more than half the bound")
        if len(hung) >= self.setup.slots:
            met.add("as many hung nodes as slots")
        if gap > self.setup.longest_cycle + self.setup.timeout:
            met.add("a gap of more than a cycle and a timeout")

    def count_arrivals(self, since: int) -> int:
        return sum(at >= since for at in self.arrivals)

    @staticmethod
    def was_there(one: Seen, since: int) -> bool:
        return one.there_since is not None or one.there >= since


def rest(failures: int) -> int:
    return [1, 2, 4, 8, 8][min(failures, 5) - 1]


# -- the driver, and the world -------------------------------------------------------------------

names = st.sampled_from(NAMES)
modes = st.sampled_from([LIVE, LIVE, HUNG, HUNG, FAILING, LATE])
easy = st.builds(
    Setup,
    interval=st.sampled_from([S, S, S // 2, 5 * S]),
    budget=st.sampled_from([10 * S, 10 * S, 2 * S, S // 2, S // 10]),
    timeout=st.sampled_from([S // 2, S // 2, S, 2 * S]),
    slots=st.sampled_from([1, 2, 3, 4, 6, 9]),
    forget_after=st.sampled_from([0, S, 20 * S]),
    answer=st.sampled_from([0, S // 100, S // 10, S // 2]),
)
hard = st.builds(
    Setup,
    interval=st.just(S // 2),
    budget=st.sampled_from([S // 2, S // 5, 3 * S]),
    timeout=st.sampled_from([S // 2, S, 2 * S]),
    slots=st.sampled_from([1, 1, 2, 3]),
    forget_after=st.just(S),
    answer=st.sampled_from([S // 10, S // 2]),
)


class Machine(RuleBasedStateMachine):
    setup: Setup

    @initialize(setup=easy | hard, who=st.sets(names, min_size=2))
    def build(self, setup: Setup, who: set[str]) -> None:
        self.setup = setup
        self.plan, self.naive, self.watch = setup.plan(), Naive(setup), Watch(setup)
        self.now = self.cycles = 0
        self.answers: list[tuple[int, str, bool, object]] = []
        # When, who, whether it succeeds, and of which request.
        self.requests: dict[str, object] = {}
        self.voided: set[object] = set()
        # Requests to a life that has ended.
        self.new_cycle = False
        self.set_targets(sorted(who))

    # -- who is there

    @rule(who=st.sets(names))
    def all_change(self, who: set[str]) -> None:
        self.set_targets(sorted(who))

    @rule(name=names)
    def come(self, name: str) -> None:
        self.set_targets([*self.there, name])

    @rule(name=names)
    def go(self, name: str) -> None:
        self.set_targets([one for one in self.there if one != name])

    @rule(name=names, mode=modes)
    def restart(self, name: str, mode: str) -> None:
        """Seen to be gone and back before anybody has taken down its request."""
        there = self.there
        self.tell_targets([one for one in there if one != name])
        self.behave(name, mode)
        self.set_targets([*there, name])

    @property
    def there(self) -> list[str]:
        return [name for name, one in self.watch.seen.items() if one.there_since is not None]

    def set_targets(self, targets: list[str]) -> None:
        self.tell_targets(targets)
        self.turn()

    def tell_targets(self, targets: list[str]) -> None:
        self.voided |= {request for name, request in self.requests.items() if name not in targets}
        self.plan.set_targets(iter(targets), self.now)
        self.naive.set_targets(list(dict.fromkeys(targets)), self.now)
        self.watch.targets(targets, self.now)

    # -- how they are

    @rule(name=names, mode=modes)
    def behave(self, name: str, mode: str) -> None:
        self.watch.behave(name, mode, self.now)
        if mode == HUNG:
            self.answers = [answer for answer in self.answers if answer[1] != name]
        elif name in self.requests and not any(one[1] == name for one in self.answers):
            # It thaws, and finds a request.
            self.answer(name, self.requests[name])

    @rule(several=st.sets(names), mode=modes)
    def all_behave(self, several: set[str], mode: str) -> None:
        for name in sorted(several):
            self.behave(name, mode)

    def answer(self, name: str, request: object) -> None:
        mode = self.watch.seen[name].mode
        # Some at once, some as late as a live node may; and each now so, now so.
        share = (NAMES.index(name) + self.naive.polls // 5) % 3
        takes = min(self.setup.answer, self.setup.timeout) * share // 2
        takes += self.setup.timeout + 1 if mode == LATE else 0
        if mode != HUNG:
            self.answers.append((self.now + takes, name, mode != FAILING, request))

    # -- what the driver is told besides

    @rule(name=names)
    def nudge(self, name: str) -> None:
        self.plan.nudge(name, self.now)
        self.naive.nudge(name)
        self.watch.seen[name].nudged = self.watch.seen[name].there_since is not None
        self.turn()

    @rule(name=st.sampled_from([*NAMES, "nobody"]), answered=st.booleans())
    def stray(self, name: str, *, answered: bool) -> None:
        """Of a request that was taken down long ago, or was never made."""
        if name not in self.requests:
            before = self.plan.stats()
            (self.plan.answered if answered else self.plan.failed)(name, self.now)
            assert self.plan.stats() == before

    # -- time

    @rule(share=st.sampled_from([0.1, 0.5, 1, 3]), of=st.sampled_from(["interval", "timeout"]))
    def wait(self, share: float, of: str) -> None:
        self.run_until(self.now + int(share * getattr(self.setup, of)))

    @rule(beside=st.sampled_from([-1, 0, 1]))
    def wait_until_due(self, beside: int) -> None:
        self.run_until(max(self.now, self.plan.next_due_ns() + beside))

    @rule(cycles=st.integers(5, 20))
    def wait_long(self, cycles: int) -> None:
        self.run_until(self.now + cycles * self.setup.interval)

    @rule(hung=st.sets(names, max_size=6), cycles=st.integers(20, 40))
    def leave_alone(self, hung: set[str], cycles: int) -> None:
        """Until what was before counts no more, and the bound is at its tightest."""
        for name in NAMES:
            self.behave(name, HUNG if name in hung else LIVE)
        self.run_until(self.now + cycles * self.setup.interval)

    @rule(share=st.sampled_from([0.3, 1, 2.5, 100]))
    def oversleep(self, share: float) -> None:
        self.now += int(share * self.setup.interval)
        self.watch.overslept(self.now)
        self.deliver()
        self.turn()

    def run_until(self, end: int) -> None:
        while True:
            coming = min((at for at, *_ in self.answers), default=end + 1)
            if (coming := min(coming, self.plan.next_due_ns())) > end:
                self.now = end
                return
            self.now = max(self.now, coming)
            self.deliver()
            self.turn()

    def deliver(self) -> None:
        due = [answer for answer in self.answers if answer[0] <= self.now]
        self.answers = [answer for answer in self.answers if answer[0] > self.now]
        for _, name, answered, request in sorted(due, key=lambda answer: answer[:2]):
            if self.requests.get(name) is request:
                (self.plan.answered if answered else self.plan.failed)(name, self.now)
                self.naive.land(name, self.now, answered=answered)
                self.landed(name, answered=answered)
            else:
                met.add("a late answer")
                self.stray(name, answered=answered)

    def turn(self) -> None:
        """What a driver does when something has happened, and when it is due."""
        while self.plan.next_due_ns() <= self.now:
            assert self.does_something()

    def does_something(self) -> bool:
        overdue = self.plan.overdue(self.now)
        assert sorted(overdue) == sorted(self.naive.overdue(self.now))
        for name in overdue:
            self.landed(name, answered=False)
        forgotten = self.plan.forgotten(self.now)
        assert forgotten == self.naive.forgotten(self.now)
        self.watch.forgotten(forgotten, self.now)
        begun = self.plan.begin(self.now)
        assert begun == self.naive.begin(self.now)
        self.begun(begun)
        return bool(overdue or forgotten or begun) or self.new_cycle

    def landed(self, name: str, *, answered: bool) -> None:
        request = self.requests.pop(name)
        ignored = request in self.voided
        if ignored:
            met.add("a request to a life that has ended")
        self.watch.land(name, self.plan.stats().cycles, answered=answered, ignored=ignored)

    def begun(self, begun: list[str]) -> None:
        cycles = self.plan.stats().cycles
        self.new_cycle = cycles > self.cycles
        if self.new_cycle:
            assert cycles == self.cycles + 1
            assert self.now >= self.watch.cycle_start + self.setup.interval or cycles == 1
            self.cycles, self.watch.cycle_start = cycles, self.now
        self.watch.begin(begun, cycles, self.now)
        for name in begun:
            self.requests[name] = object()
            self.answer(name, self.requests[name])

    # -- after each step

    @precondition(lambda self: hasattr(self, "plan"))
    @invariant()
    def both_agree(self) -> None:
        stats = self.plan.stats()
        assert stats == self.naive.stats()
        assert self.plan.in_flight == stats.in_flight == len(self.requests) <= self.setup.slots
        # Whoever vanishes gives its slot back at once.
        assert self.voided.isdisjoint(self.requests.values())
        if stats.cut_cycles:
            met.add("a cycle that was cut")

    @precondition(lambda self: hasattr(self, "plan"))
    @invariant()
    def nobody_has_waited_too_long(self) -> None:
        for name in NAMES:
            self.watch.check_wait(name, self.now)

    @precondition(lambda self: hasattr(self, "plan"))
    @invariant()
    def there_is_nothing_to_do_before_it_is_due_and_something_then(self) -> None:
        due = self.plan.next_due_ns()
        assert due > self.now
        assert not would_do_something(self.plan, due - 1)
        assert would_do_something(self.plan, due)


def would_do_something(plan: PollPlan, now: int) -> bool:
    tried, cycles = copy.deepcopy(plan), plan.stats().cycles
    done = [tried.overdue(now), tried.forgotten(now), tried.begin(now)]
    return any(done) or tried.stats().cycles > cycles


@pytest.fixture
def _nothing_met() -> Iterator[None]:
    met.clear()
    yield
    met.clear()


@pytest.mark.timeout(600)
@pytest.mark.usefixtures("_nothing_met")
def test_whatever_happens_the_plan_keeps_its_promises() -> None:
    run(Machine, runs=RUNS, steps_per_run=STEPS_PER_RUN)
    assert met >= {
        "a cycle that was cut",
        "a gap of more than a cycle and a timeout",
        "a gap of more than half the bound",
        "a late answer",
        "a request to a life that has ended",
        "as many hung nodes as slots",
        "failed 5 times",
        "silent ones wait while slots are kept free",
    }
