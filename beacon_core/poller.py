"""Whom to ask next, and when to give up: the plan of a source that must ask many nodes.

Theory. A cycle starts every *interval*, and asks each node once that is not backing off. So many
requests may be in flight at once as there are *slots*. A live node gives its slot back quickly; a
hung one holds it for the whole *timeout*. So nodes are told apart by what is known of them::

    NEW      not asked yet in this life     --answered--> PROVEN   --failed--> SILENT
    PROVEN   answered when last asked       --answered--> PROVEN   --failed--> SILENT
    SILENT   failed when last asked         --answered--> PROVEN   --failed--> SILENT
    any      --vanished--> gone             --seen again--> NEW: it was restarted, most likely

The three kinds take turns, each in the order in which its nodes became due. SILENT and NEW ones
together leave free half of the slots, rounded up, or as many as there are PROVEN nodes if those are
fewer: so nodes that are known to hang hold up nobody, however many they are, and yet at the start
all slots serve the newcomers. (With a single slot, the turns are all there is.)

A node may wait for its turn longer than a cycle lasts. It keeps its place, those asked meanwhile
come behind it, and nobody starves. What ends a cycle is that no PROVEN node waits and the interval
is over; or else, that interval and *budget* are over. After the budget no poll begins until the
next cycle, but for nudges. NEW nodes do not wait for a cycle: they are due when they come.

After n failures in a row a SILENT node rests for 1, 2, 4, 8, 8, ... whole cycles after the one in
which it failed. A nudge makes any node due at once, ahead of all.

How long a live node waits. Let x answer each poll within r <= timeout, among w other nodes of which
H do not, and h of these are PROVEN: they hang anew. While x is due and polls may begin, all slots
are busy, and nobody is asked twice ahead of it. If ``slots > H``, the hung ones leave it
``slots - H``; if not, the PROVEN have half of the slots for themselves. So it waits at most ::

    D = w * r / (slots - H)                          if slots > H
    D = (w * r + h * timeout) / ceil(slots / 2)      if slots > 1; the smaller one, if both hold
    D = w * r + h * timeout + 2 * (w + 1) * timeout  with one slot: others' turns come between

It is due when the next cycle starts, at most ``M = max(interval, min(budget, timeout + D))`` after
this one did: who is due later than at its start was in flight then. Or, if x itself is in flight
when the next cycle starts, it is due when it has answered. A budget that is shorter than the
interval makes a pause of ``P = max(0, interval - budget)``, in D ``n = floor(D / budget)`` times.
So between the starts of two polls of x there is never more than ::

    max(M + n * P, r + (n + 1) * P) + D

With fewer hung nodes than slots, others that answer at once and a budget of at least the interval,
that is the longer one of interval and timeout, also if the hung ones begin to hang at the worst
moment. A nudge may add a timeout to D. Whatever the driver comes too late adds to the gap.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterable

import attrs

from beacon_core.checks import at_least_one, nanoseconds
from beacon_core.errors import ConfigError

__all__ = ["PollPlan", "PollStats"]

_LEAST_S = 0.1
"""The least interval, budget and timeout; ros2_medkit has the same."""

_MOST_DOUBLINGS = 3
"""A node that stays silent is asked in each 9th cycle: it costs little, and when it is back that is
seen in less than a minute at the default interval."""


@attrs.frozen
class PollStats:
    """What a plan has done so far, and what it is at."""

    targets: int
    in_flight: int
    backing_off: int
    """Targets that failed and rest."""
    cycles: int
    """Cycles that have started."""
    polls: int
    """Polls that have begun."""
    failures: int
    """Polls that failed or were overdue; not those of nodes that vanished meanwhile."""
    last_cycle_ns: int
    """How long it took, the last time, until everybody due had been asked and had answered. A cycle
    that was not that far when the next one started counts with its whole length."""
    cut_cycles: int
    """Cycles whose budget was spent while somebody was still waiting."""


class PollPlan:
    """The plan; the theory is at the top of this module. Its owner carries it out::

        drop_requests(plan.overdue(now)); destroy_clients(plan.forgotten(now))
        send_requests(plan.begin(now))

    again at ``next_due_ns()``, and after each call of one of the other methods. Any time costs are
    O(1) per poll, and O(targets) in :meth:`set_targets`.

    Times are nanoseconds of a monotonic clock; one that goes back counts as no time. Thread rule:
    none of its own; the owner holds a lock, or calls from one thread.
    """

    def __init__(
        self,
        *,
        interval_s: float = 5.0,
        budget_s: float = 10.0,
        timeout_s: float = 2.0,
        max_in_flight: int = 128,
        forget_after_s: float = 60.0,
        now_ns: int,
    ) -> None:
        """The first cycle starts at the first :meth:`begin`.

        Raises ``ConfigError`` for a time or a cap that cannot work.
        """
        self._interval_ns = _time("interval_s", interval_s)
        self._budget_ns = _time("budget_s", budget_s)
        self._timeout_ns = _time("timeout_s", timeout_s)
        self._slots = at_least_one("max_in_flight", max_in_flight)
        self._forget_after_ns = nanoseconds("forget_after_s", forget_after_s)
        self._now_ns = now_ns
        self._started_ns = now_ns - self._interval_ns
        self._nodes: dict[str, _Node] = {}
        self._vanished: OrderedDict[str, int] = OrderedDict()
        # When each vanished, the earliest first.
        self._flights: OrderedDict[str, _Node] = OrderedDict()
        # In the order of their deadlines. A node that vanishes is overdue at once.
        self._urgent: _Queue = OrderedDict()
        self._new: _Queue = OrderedDict()
        self._silent: _Queue = OrderedDict()
        self._proven: _Queue = OrderedDict()
        self._turns = deque([self._new, self._silent, self._proven])
        self._asked: _Queue = OrderedDict()
        # PROVEN in this cycle: due in the next one.
        self._resting: dict[int, _Queue] = {}
        # By the cycle in which they are due.
        self._proven_count = 0
        self._unproven_in_flight = 0
        self._over = True
        # All of this cycle's polls have been answered, at least once.
        self._cycles = self._polls = self._failures = self._cut_cycles = self._last_cycle_ns = 0

    @property
    def in_flight(self) -> int:
        """How many polls are in flight now."""
        return len(self._flights)

    def set_targets(self, names: Iterable[str], now_ns: int) -> None:
        """Say which nodes there are now; those not named have vanished.

        A newcomer is due at once, also if the cycle has already asked all others. The poll of one
        that vanished is overdue at once, and what comes of it is ignored.
        """
        self._at(now_ns)
        targets = dict.fromkeys(names)
        for name in [name for name in self._nodes if name not in targets]:
            self._vanish(name)
        for name in targets:
            if name not in self._nodes:
                self._appear(name)

    def begin(self, now_ns: int) -> list[str]:
        """Whom to ask now. Each is in flight until it is answered, failed or overdue."""
        self._at(now_ns)
        if self._now_ns >= self._cycle_due_ns():
            self._start_cycle()
        begun = []
        while self._may_begin():
            begun.append(self._launch(self._next_queue()))
        self._note_if_over()
        return begun

    def overdue(self, now_ns: int) -> list[str]:
        """Whose poll has lasted ``timeout_s``: it has failed, and the caller drops its requests.

        Also those that vanished while in flight; they may be asked again as soon as this is called.
        """
        self._at(now_ns)
        overdue = []
        while self._flights and (name := self._first_overdue()) is not None:
            self._land(name, answered=False)
            overdue.append(name)
        return overdue

    def answered(self, name: str, now_ns: int) -> None:
        """It answered. Ignored of a node that is not in flight: the answer is too late."""
        self._at(now_ns)
        if name in self._flights:
            self._land(name, answered=True)

    def failed(self, name: str, now_ns: int) -> None:
        """It answered with an error, or its service went away. Ignored as in :meth:`answered`."""
        self._at(now_ns)
        if name in self._flights:
            self._land(name, answered=False)

    def nudge(self, name: str, now_ns: int) -> None:
        """Ask it at the next :meth:`begin`, ahead of its turn, if there is a slot.

        Neither its back-off nor a spent budget matter. One in flight is asked once more afterwards;
        a name that is no target is ignored.
        """
        self._at(now_ns)
        node = self._nodes.get(name)
        if node is not None and not node.nudged:
            node.nudged = True
            if node.queue is not None:
                self._file(node)

    def forgotten(self, now_ns: int) -> list[str]:
        """Who vanished ``forget_after_s`` ago and has not come back. Each is named once."""
        self._at(now_ns)
        forgotten = []
        while self._vanished and self._forget_due_ns() <= self._now_ns:
            forgotten.append(self._vanished.popitem(last=False)[0])
        return forgotten

    def next_due_ns(self) -> int:
        """When ``begin``, ``overdue`` or ``forgotten`` have something to do next, exactly.

        Earlier they do nothing, unless one of the other methods is called meanwhile. In the past if
        there is something to do already.
        """
        due_ns = self._cycle_due_ns()
        if self._flights:
            due_ns = min(due_ns, next(iter(self._flights.values())).deadline_ns)
        if self._vanished:
            due_ns = min(due_ns, self._forget_due_ns())
        return min(due_ns, self._now_ns) if self._may_begin() else due_ns

    def stats(self) -> PollStats:
        """The numbers of this moment."""
        return PollStats(
            targets=len(self._nodes),
            in_flight=len(self._flights),
            backing_off=sum(map(len, self._resting.values())),
            cycles=self._cycles,
            polls=self._polls,
            failures=self._failures,
            last_cycle_ns=self._last_cycle_ns,
            cut_cycles=self._cut_cycles,
        )

    def _at(self, now_ns: int) -> None:
        self._now_ns = max(self._now_ns, now_ns)

    # -- cycles

    def _cycle_due_ns(self) -> int:
        if self._proven:
            return self._started_ns + max(self._interval_ns, self._budget_ns)
        return self._started_ns + self._interval_ns

    def _start_cycle(self) -> None:
        if not self._over:
            self._last_cycle_ns = self._now_ns - self._started_ns
        if self._cycles and self._is_budget_spent() and any(self._turns):
            self._cut_cycles += 1
        self._cycles += 1
        self._started_ns, self._over = self._now_ns, False
        _move_all(self._asked, self._proven)
        _move_all(self._resting.pop(self._cycles, OrderedDict()), self._silent)

    def _is_budget_spent(self) -> bool:
        return self._now_ns >= self._started_ns + self._budget_ns

    def _note_if_over(self) -> None:
        if not (self._over or self._flights or any(self._turns)):
            self._over, self._last_cycle_ns = True, self._now_ns - self._started_ns

    # -- turns

    def _may_begin(self) -> bool:
        if len(self._flights) >= self._slots:
            return False
        return bool(self._urgent) or (
            not self._is_budget_spent() and any(map(self._may_begin_of, self._turns))
        )

    def _may_begin_of(self, queue: _Queue) -> bool:
        if queue is self._proven:
            return bool(queue)
        kept = min((self._slots + 1) // 2, self._proven_count)
        # An unproven node that answers gives back a slot as it becomes one of those to be kept for.
        return bool(queue) and self._unproven_in_flight < max(1, self._slots - kept)

    def _next_queue(self) -> _Queue:
        if self._urgent:
            return self._urgent
        self._turns.rotate(-1)
        while not self._may_begin_of(self._turns[-1]):
            self._turns.rotate(-1)
        return self._turns[-1]

    # -- a node's life

    def _appear(self, name: str) -> None:
        self._vanished.pop(name, None)
        node = self._nodes[name] = _Node(name)
        # If not even the request of its last life has come down yet, it waits for that.
        if name not in self._flights:
            self._file(node)

    def _vanish(self, name: str) -> None:
        node = self._nodes.pop(name)
        node.move(None)
        self._proven_count -= node.proven
        self._vanished[name] = self._now_ns
        if self._flights.get(name) is node:
            node.deadline_ns = self._now_ns
            self._flights.move_to_end(name, last=False)

    def _launch(self, queue: _Queue) -> str:
        node = next(iter(queue.values()))
        node.move(None)
        node.nudged, node.cycle = False, self._cycles
        node.deadline_ns = self._now_ns + self._timeout_ns
        self._flights[node.name] = node
        self._unproven_in_flight += not node.proven
        self._polls += 1
        return node.name

    def _land(self, name: str, *, answered: bool) -> None:
        flown, node = self._flights.pop(name), self._nodes.get(name)
        self._unproven_in_flight -= not flown.proven
        if node is flown:
            self._learn(node, answered=answered)
        if node is not None:
            self._file(node)
        self._note_if_over()

    def _learn(self, node: _Node, *, answered: bool) -> None:
        self._proven_count += answered - node.proven
        self._failures += not answered
        node.proven, node.failures = answered, 0 if answered else node.failures + 1

    def _file(self, node: _Node) -> None:
        if node.nudged:
            node.move(self._urgent)
        elif node.failures:
            rest = 1 << min(node.failures - 1, _MOST_DOUBLINGS)
            node.move(self._resting.setdefault(self._cycles + rest + 1, OrderedDict()))
        elif not node.proven:
            node.move(self._new)
        else:
            node.move(self._asked if node.cycle == self._cycles else self._proven)

    def _first_overdue(self) -> str | None:
        node = next(iter(self._flights.values()))
        return node.name if node.deadline_ns <= self._now_ns else None

    def _forget_due_ns(self) -> int:
        return next(iter(self._vanished.values())) + self._forget_after_ns


@attrs.define(eq=False)
class _Node:
    """One life of a target, from when it was first seen to when it vanished."""

    name: str
    proven: bool = False
    failures: int = 0
    """In a row."""
    nudged: bool = False
    cycle: int = 0
    """The one in which it was last asked."""
    deadline_ns: int = 0
    """Of its poll, while in flight."""
    queue: _Queue | None = None
    """Where it stands; ``None`` while a poll of this name is in flight."""

    def move(self, queue: _Queue | None) -> None:
        if self.queue is not None:
            del self.queue[self.name]
        self.queue = queue
        if queue is not None:
            queue[self.name] = self


# A plain dict is slow to find its first item after many first ones have been taken out.
_Queue = OrderedDict[str, _Node]


def _move_all(source: _Queue, destination: _Queue) -> None:
    for node in list(source.values()):
        node.move(destination)


def _time(key: str, seconds: float) -> int:
    length_ns = nanoseconds(key, seconds)
    if seconds < _LEAST_S:
        raise ConfigError(
            f"{key}: {seconds} is not possible; give a number of seconds, at least {_LEAST_S}"
        )
    return length_ns
