"""The rules of the poll plan, written naively; and the bound, as its theory states it."""

from __future__ import annotations

import attrs

from beacon_core.poller import PollPlan, PollStats

__all__ = ["Naive", "Setup"]

S = 1_000_000_000


@attrs.frozen
class Setup:
    """A plan's configuration in nanoseconds, and how quickly live nodes answer at the latest."""

    interval: int
    budget: int
    timeout: int
    slots: int
    forget_after: int
    answer: int

    def plan(self) -> PollPlan:
        return PollPlan(
            interval_s=self.interval / S,
            budget_s=self.budget / S,
            timeout_s=self.timeout / S,
            max_in_flight=self.slots,
            forget_after_s=self.forget_after / S,
            now_ns=0,
        )

    @property
    def longest_cycle(self) -> int:
        return max(self.interval, self.budget)

    def largest_gap(self, others: int, hung: int, anew: int, nudges: int) -> int:
        """The bound, letter by letter as it stands in the theory of ``beacon_core.poller``."""
        w, r = others, self.answer
        if self.slots == 1:
            waits = [w * r + anew * self.timeout + 2 * (w + 1) * self.timeout]
        else:
            waits = [-(-(w * r + anew * self.timeout) // -(-self.slots // 2))]
        if self.slots > hung:
            waits.append(-(-w * r // (self.slots - hung)))
        wait = min(waits) + nudges * self.timeout
        cycle = max(self.interval, min(self.budget, self.timeout + wait))
        pause, pauses = max(0, self.interval - self.budget), wait // self.budget
        return max(cycle + pauses * pause, r + (pauses + 1) * pause) + wait

    def longest_return(self, polls: int) -> int:
        """Until a node that failed or is new is asked, if so many polls at most come before it."""
        wait = polls * self.timeout
        pause = max(0, self.interval - self.budget)
        return 9 * self.longest_cycle + wait + (wait // self.budget + 1) * pause


@attrs.define(eq=False)
class Node:
    name: str
    kind: str = "new"
    place: str = "due"
    """Or: in the air, asked, resting, urgent."""
    order: int = 0
    """Of who has come to the same place, the one with the least came first."""
    failures: int = 0
    cycle: int = 0
    wake: int = 0
    nudged: bool = False


@attrs.define(eq=False)
class Flight:
    node: Node
    kind: str
    deadline: int


class Naive:
    """Whatever is asked, all nodes are looked through."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.nodes: list[Node] = []
        self.air: list[Flight] = []
        self.vanished: dict[str, int] = {}
        self.start = -setup.interval
        self.kinds = ["new", "silent", "proven"]
        self.orders = self.cycles = self.polls = self.failures = self.cut = self.took = 0
        self.over = True

    def stats(self) -> PollStats:
        resting = [node for node in self.nodes if node.place == "resting"]
        return PollStats(
            len(self.nodes),
            len(self.air),
            len(resting),
            self.cycles,
            self.polls,
            self.failures,
            self.took,
            self.cut,
        )

    def find(self, name: str) -> Node | None:
        return next((node for node in self.nodes if node.name == name), None)

    def put(self, node: Node, place: str) -> None:
        self.orders += 1
        node.place, node.order = place, self.orders

    def waiting(self, *kinds: str, place: str = "due") -> list[Node]:
        found = [node for node in self.nodes if node.place == place and node.kind in kinds]
        return sorted(found, key=lambda node: node.order)

    def set_targets(self, names: list[str], now: int) -> None:
        for node in [node for node in self.nodes if node.name not in names]:
            self.nodes.remove(node)
            self.vanished[node.name] = now
            for flight in self.air:
                if flight.node is node:
                    flight.deadline = now
        for name in names:
            if self.find(name) is None:
                self.vanished.pop(name, None)
                self.nodes.append(Node(name))
                self.put(self.nodes[-1], "due")
                if any(flight.node.name == name for flight in self.air):
                    self.nodes[-1].place = "air"

    def begin(self, now: int) -> list[str]:
        setup, proven_wait = self.setup, self.waiting("proven")
        if now >= self.start + (setup.longest_cycle if proven_wait else setup.interval):
            self.start_cycle(now)
        begun = []
        while len(self.air) < setup.slots and (node := self.choose(now)) is not None:
            self.air.append(Flight(node, node.kind, now + setup.timeout))
            node.place, node.cycle, node.nudged = "air", self.cycles, False
            self.polls += 1
            begun.append(node.name)
        self.measure(now)
        return begun

    def start_cycle(self, now: int) -> None:
        if not self.over:
            self.took = now - self.start
        everybody = self.waiting(*self.kinds)
        self.cut += bool(self.cycles and everybody and now >= self.start + self.setup.budget)
        self.cycles, self.start, self.over = self.cycles + 1, now, False
        for node in self.waiting("proven", place="asked"):
            self.put(node, "due")
        for node in self.waiting("silent", place="resting"):
            if node.wake == self.cycles:
                self.put(node, "due")

    def choose(self, now: int) -> Node | None:
        if urgent := self.waiting(*self.kinds, place="urgent"):
            return urgent[0]
        if now >= self.start + self.setup.budget:
            return None
        for kind in self.kinds:
            if (due := self.waiting(kind)) and (kind == "proven" or self.lane_is_free()):
                turn = self.kinds.index(kind) + 1
                self.kinds = self.kinds[turn:] + self.kinds[:turn]
                return due[0]
        return None

    def lane_is_free(self) -> bool:
        slots = self.setup.slots
        proven = sum(node.kind == "proven" for node in self.nodes)
        unproven = sum(flight.kind != "proven" for flight in self.air)
        return unproven < max(1, slots - min(-(-slots // 2), proven))

    def overdue(self, now: int) -> list[str]:
        over = [flight.node.name for flight in self.air if flight.deadline <= now]
        for name in over:
            self.land(name, now, answered=False)
        return over

    def land(self, name: str, now: int, *, answered: bool) -> None:
        for flight in [flight for flight in self.air if flight.node.name == name]:
            self.air.remove(flight)
            node = self.find(name)
            if node is flight.node:
                node.kind = "proven" if answered else "silent"
                node.failures = 0 if answered else node.failures + 1
                self.failures += not answered
            if node is not None:
                self.place(node)
            self.measure(now)

    def place(self, node: Node) -> None:
        if node.nudged:
            self.put(node, "urgent")
        elif node.failures:
            node.wake = self.cycles + 1 + [1, 2, 4, 8][min(node.failures, 4) - 1]
            self.put(node, "resting")
        else:
            self.put(node, "asked" if (node.kind, node.cycle) == ("proven", self.cycles) else "due")

    def measure(self, now: int) -> None:
        if not self.over and not self.air and not self.waiting(*self.kinds):
            self.over, self.took = True, now - self.start

    def nudge(self, name: str) -> None:
        node = self.find(name)
        if node is not None and not node.nudged:
            node.nudged = True
            if node.place != "air":
                self.put(node, "urgent")

    def forgotten(self, now: int) -> list[str]:
        gone = [n for n, then in self.vanished.items() if then + self.setup.forget_after <= now]
        for name in gone:
            del self.vanished[name]
        return gone
