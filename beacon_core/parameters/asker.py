"""Carries out the plan: asks nodes for their parameters and tells a sink what follows.

Theory. A node is seen in the graph, asked as long as it is there, and leaves::

    SEEN     its services are looked for: at once, and then ever more rarely, for many nodes have
             none. The GID that names its run may not be known for the first 100 ms, and is
             waited for
    OPEN     the plan says when to ask it: what are its parameters, and what are their values. The
             answer is compared with the last one, as it came: nearly always it is the same, and
             nothing has to be read or written anew
    LEFT     if it is gone, or its GID is another: it was restarted. What was told of it is lost

What is told of all that, and when, is the business of :mod:`.teller`.

Here is no ROS, no thread and no clock: whoever owns this hands in the graph, events and the time.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from beacon_core.parameters.fields import MAX_PARAMETERS, is_ours
from beacon_core.parameters.polling import Polling
from beacon_core.parameters.target import Poll, Target
from beacon_core.parameters.teller import Teller
from beacon_core.poller import PollPlan
from beacon_core.ports.asking import ClientFactory, Done, Drop, NodeClient
from beacon_core.ports.sink import HintSink

__all__ = ["MAX_TARGETS", "Asker"]

_log = logging.getLogger(__name__)

MAX_TARGETS = 1_000
"""Nodes that are asked; by rclpy each takes 230 kB. Twice the largest robots there are; a flood of
invented nodes beyond it is counted and ignored."""

_MS = 1_000_000

_OPEN_AT_ONCE = 4
"""Nodes whose services are looked for before others get their turn: in rclpy the two clients of one
take 2 to 10 ms."""

_LOOK_AGAIN_NS = 10 * _MS
"""The first wait for services that are not there yet; each further one is twice as long."""

_WAIT_FOR_GID_NS = 1000 * _MS
"""Ten times as long as it takes; then it is asked without."""

_SETTLE_NS = 20 * _MS
"""From an event to the question: a node declares its parameters one by one, each with an event."""

_AT_MOST_EVERY_NS = 100 * _MS
"""Events do not make a node be asked more often than this."""

_Then = Callable[[Target, Poll, Sequence[Any] | None, int], None]


class Asker:
    """Thread rule: one thread, but for ``stop``, ``counters`` and ``silent``: those any."""

    def __init__(
        self,
        options: Polling,
        open_client: ClientFactory,
        sink: HintSink,
        wake: Callable[[], None],
        now_ns: int,
    ) -> None:
        """``wake``: called from any thread when there is something to do for :meth:`step`."""
        self.namesakes: tuple[str, ...] = ()
        """Names of targets that several nodes have; replaced as a whole."""
        self._interval_ns = round(options.interval_s * 1e9)
        self._plan = PollPlan(
            interval_s=options.interval_s,
            budget_s=options.budget_s,
            timeout_s=options.timeout_s,
            max_in_flight=options.max_in_flight,
            forget_after_s=options.forget_after_s,
            now_ns=now_ns,
        )
        self._stats = self._plan.stats()
        self._teller = Teller(sink, now_ns)
        self._open_client, self._wake = open_client, wake
        self._targets: dict[str, Target] = {}
        self._seen: dict[str, Target] = {}
        self._kept: dict[str, NodeClient] = {}
        # Of nodes that have left, until the plan forgets them.
        self._nudges: dict[str, int] = {}
        self._answers: deque[tuple[_Then, Target, Poll, Sequence[Any] | None]] = deque()
        self._refused = self._nudged = 0

    def stop(self) -> None:
        """Tell the sink nothing any more."""
        self._teller.stop()

    def close(self) -> None:
        """Give up all questions, and what it took to ask them."""
        self.stop()
        clients = [*self._kept.values(), *(one.client for one in self._targets.values())]
        for target in self._targets.values():
            self._end_poll(target)
        for client in clients:
            if client is not None:
                client.close()
        self._targets.clear()

    def see(
        self,
        runs: Mapping[str, Collection[str]],
        wanted: Iterable[str],
        now_ns: int,
        *,
        why_gone: str = "its node left the ROS graph",
    ) -> None:
        """The nodes of the graph by name, with the GIDs of those who have it, and whom to ask.

        Who is there but not wanted any more is not asked, and nothing is told of it. ``why_gone``
        is the reason, for people, why somebody is not there any more.
        """
        wanted = dict.fromkeys(name for name in wanted if name in runs)
        for target in list(self._targets.values()):
            if target.name not in runs:
                self._leave(target, why_gone, now_ns)
            elif target.name not in wanted:
                self._remove(target)
            elif not _is_run(target, runs[target.name]):
                self._leave(target, "its node was started again", now_ns)
            elif not (target.incarnation or target.open):
                self._name_run(target, runs[target.name], now_ns)
        self._tell_plan(now_ns)
        newcomers = [name for name in wanted if name not in self._targets]
        room = MAX_TARGETS - len(self._targets)
        self._refused = len(newcomers[room:])
        for name in newcomers[:room]:
            target = Target(name, now_ns, self._kept.pop(name, None))
            self._targets[name] = self._seen[name] = target
            self._name_run(target, runs[name], now_ns)
        self.namesakes = tuple(name for name in wanted if len(runs[name]) > 1)

    def changed(self, name: str, now_ns: int, *, leaving: bool | None = None) -> bool:
        """An event told that the node's parameters have changed; and that its hint has gone, or has
        not, or nothing about that. Says whether the node is known; if not, look at the graph."""
        target = self._targets.get(name)
        if target is None:
            return False
        if leaving is not None:
            target.left_ns = now_ns if leaving else 0
        due_ns = max(now_ns + _SETTLE_NS, target.asked_ns + _AT_MOST_EVERY_NS)
        self._nudges.setdefault(name, due_ns)
        return True

    def step(self, now_ns: int) -> int:
        """Do what is due; returns when to be called next, at the latest (nanoseconds)."""
        while self._answers:
            then, target, poll, answer = self._answers.popleft()
            if target.poll is poll:
                then(target, poll, answer, now_ns)
        for name in self._plan.overdue(now_ns):
            self._give_up(name, now_ns)
        for name in self._plan.forgotten(now_ns):
            if name in self._kept:
                self._kept.pop(name).close()
        self._look_for_services(now_ns)
        self._nudge(now_ns)
        while begun := self._plan.begin(now_ns):
            for name in begun:
                self._ask(self._targets[name], now_ns)
        self._stats = self._plan.stats()
        tries = (one.try_ns for one in self._seen.values())
        return min([self._plan.next_due_ns(), *self._nudges.values(), *tries])

    def counters(self) -> dict[str, int]:
        """How much has been done, and how much there is of what; names in kebab-case."""
        stats, targets = self._stats, list(self._targets.values())
        return {
            **self._teller.counts,
            "nudges": self._nudged,
            "targets": stats.targets,
            "unreachable": len(self._seen),
            "refused": self._refused,
            "hints": sum(bool(one.told_id) for one in targets),
            "skipped-parameters": sum(len(one.skipped) for one in targets),
            "silent": sum(one.silent for one in targets),
            "in-flight": stats.in_flight,
            "backing-off": stats.backing_off,
            "polls": stats.polls,
            "failures": stats.failures,
            "cycles": stats.cycles,
            "cycles-cut": stats.cut_cycles,
            "cycle-us": stats.last_cycle_ns // 1000,
        }

    def silent(self) -> list[str]:
        """Nodes that did not answer when last asked, though they were there."""
        return [one.name for one in list(self._targets.values()) if one.silent]

    # -- nodes come and go

    @staticmethod
    def _name_run(target: Target, runs: Collection[str], now_ns: int) -> None:
        if len(runs) == 1:
            (target.incarnation,) = runs
            target.try_ns = now_ns

    def _leave(self, target: Target, reason: str, now_ns: int) -> None:
        self._remove(target)
        self._teller.left(target, reason, now_ns)

    def _remove(self, target: Target) -> None:
        self._end_poll(target)
        name = target.name
        del self._targets[name]
        self._seen.pop(name, None)
        self._nudges.pop(name, None)
        if target.client is not None and target.open:
            self._kept[name] = target.client
        elif target.client is not None:
            target.client.close()

    def _look_for_services(self, now_ns: int) -> None:
        due = [one for one in self._seen.values() if one.try_ns <= now_ns][:_OPEN_AT_ONCE]
        for target in due:
            if self._are_there(target, now_ns):
                target.open = True
                del self._seen[target.name]
            else:
                target.wait_ns = min(max(_LOOK_AGAIN_NS, 2 * target.wait_ns), self._interval_ns)
                target.try_ns = now_ns + target.wait_ns
        if any(target.open for target in due):
            self._tell_plan(now_ns)

    def _are_there(self, target: Target, now_ns: int) -> bool:
        try:
            if target.client is None:
                target.client = self._open_client(target.name)
            known = target.incarnation or now_ns - target.seen_ns >= _WAIT_FOR_GID_NS
            return bool(known) and target.client.ready()
        except Exception:  # noqa: BLE001 - names in the graph are foreign: some no client can have
            _log.debug("%r cannot be asked", target.name, exc_info=True)
            return False

    def _tell_plan(self, now_ns: int) -> None:
        self._plan.set_targets([one.name for one in self._targets.values() if one.open], now_ns)

    # -- questions and answers

    def _nudge(self, now_ns: int) -> None:
        for name in [name for name, due_ns in self._nudges.items() if due_ns <= now_ns]:
            del self._nudges[name]
            self._nudged += 1
            self._plan.nudge(name, now_ns)

    def _ask(self, target: Target, now_ns: int) -> None:
        target.asked_ns = now_ns
        target.poll = poll = Poll(now_ns)
        client = target.client
        if client is None or not (target.proven or client.ready()):
            self._fail(target, now_ns)
        else:
            self._send(target, poll, client.list_names, self._on_names, now_ns)

    def _send(
        self,
        target: Target,
        poll: Poll,
        request: Callable[[Done], Drop],
        then: _Then,
        now_ns: int,
    ) -> None:
        def done(answer: Sequence[Any] | None) -> None:
            """In any thread."""
            self._answers.append((then, target, poll, answer))
            self._wake()

        try:
            poll.drops.append(request(done))
        except Exception:  # noqa: BLE001 - whatever ROS raises when a context ends
            _log.debug("%s cannot be asked", target.name, exc_info=True)
            self._fail(target, now_ns)

    def _on_names(
        self, target: Target, poll: Poll, names: Sequence[Any] | None, now_ns: int
    ) -> None:
        if names is None or target.client is None:
            self._fail(target, now_ns)
            return
        ours = [name for name in names if is_ours(name)][:MAX_PARAMETERS]
        poll.values = dict.fromkeys(ours)
        if ours:
            ask = partial(target.client.get_values, ours)
            self._send(target, poll, ask, self._on_values, now_ns)
        else:
            self._heard(target, poll, now_ns)

    def _on_values(
        self, target: Target, poll: Poll, values: Sequence[Any] | None, now_ns: int
    ) -> None:
        if values is None or target.client is None:
            self._fail(target, now_ns)
        elif len(values) == len(poll.values):
            poll.values = dict(zip(poll.values, values, strict=True))
            self._heard(target, poll, now_ns)
        else:
            # One of them has no value, or has just gone: then there is no answer for any.
            poll.awaited = len(poll.values)
            for name in list(poll.values):
                ask = partial(target.client.get_values, [name])
                self._send(target, poll, ask, partial(self._on_value, name), now_ns)

    def _on_value(
        self, name: str, target: Target, poll: Poll, values: Sequence[Any] | None, now_ns: int
    ) -> None:
        if values is None:
            self._fail(target, now_ns)
            return
        if values:
            poll.values[name] = values[0]
        else:
            del poll.values[name]
        poll.awaited -= 1
        if not poll.awaited:
            self._heard(target, poll, now_ns)

    def _fail(self, target: Target, now_ns: int) -> None:
        self._plan.failed(target.name, now_ns)
        self._give_up(target.name, now_ns)

    def _give_up(self, name: str, now_ns: int) -> None:
        target = self._targets.get(name)
        if target is None or target.poll is None:
            return
        target.proven, target.silent = False, True
        self._end_poll(target)
        self._teller.unanswered(target, now_ns)

    @staticmethod
    def _end_poll(target: Target) -> None:
        if target.poll is not None:
            target.poll.drop()
            target.poll = None

    def _heard(self, target: Target, poll: Poll, now_ns: int) -> None:
        self._plan.answered(target.name, now_ns)
        target.poll, target.proven, target.silent = None, True, False
        self._teller.heard(target, poll, now_ns)


def _is_run(target: Target, runs: Collection[str]) -> bool:
    """Is it still the same run? Not known of one whose GID is not, or of namesakes."""
    return not runs or not target.incarnation or target.incarnation in runs
