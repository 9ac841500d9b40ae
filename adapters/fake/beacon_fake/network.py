"""The simulated network: announcers and sources as named nodes, messages as events in a heap.

Theory. Nothing happens by itself. Sending a message puts one event per receiver into the heap, at
the time it will arrive; whoever drives the network lets time pass (:meth:`FakeNetwork.advance`) or
says that time has passed (:meth:`FakeNetwork.deliver_due`), and the events that are due happen, in
the order of their times and, for equal times, in the order they were sent. All chance comes from
one generator, seeded. So the same seed and the same calls give the same run, event by event.

A link behaves like a connection. What is sent over it while both ends are up arrives in order
unless the link reorders. If the sender crashes, the receiver notices, ``detect_s`` after the last
message that was under way; if the two are partitioned it does not notice. When a source starts, or
a partition heals, each live announcer it can reach tells it its present hints.
"""

from __future__ import annotations

import itertools
import random
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial

import attrs

from beacon_core.clock import Clock, ManualClock
from beacon_core.errors import ConfigError, UsageError
from beacon_fake.events import EventQueue
from beacon_fake.link import LOCAL, Link
from beacon_fake.message import Kind, Message, Receiver, Sender

__all__ = ["ANYBODY", "FakeNetwork"]

ANYBODY = "*"
"""Stands for every name in :meth:`FakeNetwork.set_link`."""

_OVERDUE_NS = 1_000_000_000
"""A driver that wakes up once a second is slow; one that has not for longer is missing."""


@attrs.define
class _Connection:
    """What is known of the traffic from one sender to one receiver."""

    queue_end_ns: int = 0
    """When the last message that keeps the order arrives."""
    last_arrival_ns: int = 0
    """When the last message of all arrives."""


class FakeNetwork:
    """Any number of announcers and sources, and everything that can go wrong between them.

    ``seed`` decides all chance. ``link`` is what every link is like unless :meth:`set_link` says
    otherwise. Thread rule: one thread at a time drives (``advance``, ``run_until_idle``,
    ``deliver_due``), never from inside a callback; everything else may be called from any thread.
    """

    def __init__(self, clock: Clock, *, seed: int = 0, link: Link = LOCAL) -> None:
        self.clock = clock
        self.seed = seed
        self.lock = threading.RLock()
        """Guards everything here, and the announcers' state. Never held during a callback."""
        self._rng = random.Random(seed)  # noqa: S311 - a simulation, no secret
        self._default_link = link
        self._links: dict[tuple[str, str], Link] = {}
        self._groups: list[frozenset[str]] = []
        self._senders: dict[str, Sender] = {}
        self._receivers: dict[str, Receiver] = {}
        self._connections: dict[tuple[str, Receiver], _Connection] = {}
        self._events = EventQueue()
        self._names = itertools.count(1)
        self._starts = itertools.count(1)
        self._counters: Counter[str] = Counter()
        self._driven = False

    def __repr__(self) -> str:
        return (
            f"FakeNetwork(seed={self.seed}, senders={len(self._senders)},"
            f" receivers={len(self._receivers)}, events={len(self._events)})"
        )

    # Time

    def deliver_due(self) -> int:
        """Let everything happen that is due by the clock; returns how many messages arrived.

        For a network on a clock that runs by itself: call it from a loop, and sleep until
        :meth:`next_due_ns` in between.
        """
        before = self._counters["delivered"]
        with self._driving():
            while (happen := self._pop_due()) is not None:
                happen()
        return self._counters["delivered"] - before

    def next_due_ns(self) -> int | None:
        """On the monotonic clock: when the next thing happens; ``None`` if nothing will."""
        with self.lock:
            return self._events.next_due_ns()

    def complaint(self) -> str:
        """What its nodes must say in their health: one sentence, "" when all is well."""
        due_ns = self.next_due_ns()
        if due_ns is not None and self.clock.monotonic_ns() - due_ns > _OVERDUE_NS:
            return "nobody drives the network: call its deliver_due() in a loop"
        return ""

    def advance(self, ns: int) -> int:
        """Let ``ns`` nanoseconds pass on the ``ManualClock``, and everything happen at its time.

        Returns how many messages arrived. Raises ``UsageError`` on any other clock.
        """
        clock = self._manual_clock()
        end_ns = clock.monotonic_ns() + ns
        arrived = self.deliver_due()
        while (due_ns := self.next_due_ns()) is not None and due_ns <= end_ns:
            clock.advance(due_ns - clock.monotonic_ns())
            arrived += self.deliver_due()
        clock.advance(end_ns - clock.monotonic_ns())
        return arrived

    def run_until_idle(self) -> int:
        """Let just so much time pass that everything now under way has arrived.

        Ends also when announcers repeat for ever. Returns how many messages arrived; raises
        ``UsageError`` unless on a ``ManualClock``.
        """
        now_ns = self._manual_clock().monotonic_ns()
        with self.lock:
            last_ns = self._events.last_arrival_ns()
        return 0 if last_ns is None else self.advance(max(0, last_ns - now_ns))

    # Faults

    def set_link(self, link: Link, *, sender: str = ANYBODY, receiver: str = ANYBODY) -> None:
        """Say what the link between two named nodes is like from now on, or all links of one.

        The pair goes before the sender, the sender before the receiver.
        """
        with self.lock:
            self._links[sender, receiver] = link

    def partition(self, *groups: Iterable[str]) -> None:
        """Split the network: a node reaches only the nodes of its own group.

        Nodes that are in no group form one more, so ``partition(["robot-1"])`` cuts off that
        robot. What is under way across a border is lost. Replaces the partition before it.
        """
        with self.lock:
            blocked_before = self._blocked_pairs()
            self._groups = [frozenset(group) for group in groups]
            self._reunite(blocked_before)

    def heal(self) -> None:
        """End the partition. Whoever can reach each other again exchanges the present hints."""
        self.partition()

    def crash(self, name: str) -> None:
        """The announcer vanishes without a goodbye; those it is connected with notice.

        Raises ``UsageError`` if there is no announcer of this name.
        """
        with self.lock:
            sender = self._senders.pop(name, None)
            if sender is None:
                raise UsageError(f"crash({name!r}): no such announcer; there are {self.names()}")
            sender.vanish()
            for receiver in self._receivers.values():
                self._break_connection(sender, receiver)

    def flood(
        self, sender: str, payload: Callable[[int], bytes], *, rate: float, duration_s: float
    ) -> None:
        """Send ``payload(0)``, ``payload(1)``, ... at ``rate`` per second, from now on."""
        begin_ns, count = self.clock.monotonic_ns(), int(rate * duration_s)

        def one(number: int) -> None:
            self.send(Message(Kind.HINT, sender, payload=payload(number)))
            follow(number + 1)

        def follow(number: int) -> None:
            if number < count:
                self.schedule(begin_ns + int(number * 1e9 / rate), partial(one, number))

        follow(0)

    def send(self, message: Message) -> None:
        """Send a message of anybody's making to every source, as an intruder might."""
        with self.lock:
            for receiver in self._receivers.values():
                self._transmit(message, receiver)

    # Nodes

    def names(self) -> list[str]:
        """The announcers on the network, in the order they came."""
        with self.lock:
            return list(self._senders)

    def free_name(self, wanted: str, kind: str) -> str:
        """``wanted``, or a new name if that is empty."""
        with self.lock:
            return wanted or f"{kind}-{next(self._names)}"

    def new_incarnation(self, name: str) -> str:
        """A name for one run of an announcer, unlike any other's on this network."""
        return f"{name}/{next(self._starts)}"

    def join_sender(self, sender: Sender) -> None:
        """Raises ``ConfigError`` if an announcer of this name is on the network."""
        with self.lock:
            self._refuse_double(sender.name, self._senders)
            self._senders[sender.name] = sender

    def join_receiver(self, receiver: Receiver) -> None:
        """From now on it hears everything, and first of all the present hints.

        Raises ``ConfigError`` if a source of this name is on the network.
        """
        with self.lock:
            self._refuse_double(receiver.name, self._receivers)
            self._receivers[receiver.name] = receiver
            for sender in self._senders.values():
                self._tell_present(sender, receiver)

    def leave(self, node: Sender | Receiver) -> None:
        """The node is gone. What it sent before still arrives. Idempotent."""
        with self.lock:
            for nodes in (self._senders, self._receivers):
                if nodes.get(node.name) is node:
                    del nodes[node.name]

    def schedule(self, due_ns: int, happen: Callable[[], None]) -> None:
        """Have a node do something by itself at ``due_ns``, such as the next beat."""
        with self.lock:
            self._events.push(due_ns, happen, in_flight=False)

    def chance(self) -> float:
        """A share from 0 to 1, by the network's seed."""
        with self.lock:
            return self._rng.random()

    def counters(self) -> dict[str, int]:
        """Totals: each message is counted once per receiver as ``sent``, and comes to one end.

        ``sent + duplicated == delivered + lost + blocked + unheard`` plus what is under way.
        """
        names = ("sent", "duplicated", "reordered", "delivered", "lost", "blocked", "unheard")
        with self.lock:
            return {name: self._counters[name] for name in names}

    # Private

    def _manual_clock(self) -> ManualClock:
        if not isinstance(self.clock, ManualClock):
            raise UsageError(
                "only a ManualClock can be moved; on another clock wait and call deliver_due()"
            )
        return self.clock

    @contextmanager
    def _driving(self) -> Iterator[None]:
        with self.lock:
            if self._driven:
                raise UsageError("the network is being driven: not from a callback, nor by two")
            self._driven = True
        try:
            yield
        finally:
            self._driven = False

    def _pop_due(self) -> Callable[[], None] | None:
        with self.lock:
            return self._events.pop_due(self.clock.monotonic_ns())

    def _refuse_double(self, name: str, nodes: Mapping[str, object]) -> None:
        if name in nodes:
            raise ConfigError(f"name: {name!r} is taken on this network; give each node its own")

    def _link(self, sender: str, receiver: str) -> Link:
        for key in ((sender, receiver), (sender, ANYBODY), (ANYBODY, receiver)):
            if key in self._links:
                return self._links[key]
        return self._links.get((ANYBODY, ANYBODY), self._default_link)

    def _blocked(self, sender: str, receiver: str) -> bool:
        return self._group(sender) != self._group(receiver)

    def _group(self, name: str) -> int:
        return next((n for n, group in enumerate(self._groups) if name in group), -1)

    def _blocked_pairs(self) -> list[tuple[Sender, Receiver]]:
        pairs = itertools.product(self._senders.values(), self._receivers.values())
        return [pair for pair in pairs if self._blocked(pair[0].name, pair[1].name)]

    def _reunite(self, blocked_before: list[tuple[Sender, Receiver]]) -> None:
        for sender, receiver in blocked_before:
            if not self._blocked(sender.name, receiver.name):
                self._tell_present(sender, receiver)

    def _tell_present(self, sender: Sender, receiver: Receiver) -> None:
        for message in sender.present():
            self._transmit(message, receiver)

    def _transmit(self, message: Message, receiver: Receiver) -> None:
        link = self._link(message.sender, receiver.name)
        self._counters["sent"] += 1
        if self._blocked(message.sender, receiver.name):
            self._counters["blocked"] += 1
        elif self._rng.random() < link.loss:
            self._counters["lost"] += 1
        else:
            self._enqueue(message, receiver, link)
            if self._rng.random() < link.duplicate:
                self._counters["duplicated"] += 1
                self._enqueue(message, receiver, link)

    def _enqueue(self, message: Message, receiver: Receiver, link: Link) -> None:
        connection = self._connections.setdefault((message.sender, receiver), _Connection())
        due_ns = max(self.clock.monotonic_ns() + link.delay_ns(self._rng), connection.queue_end_ns)
        held_back_ns = link.held_back_ns(self._rng)
        if held_back_ns:
            self._counters["reordered"] += 1
            due_ns += held_back_ns
        else:
            connection.queue_end_ns = due_ns
        connection.last_arrival_ns = max(connection.last_arrival_ns, due_ns)
        self._events.push(due_ns, partial(self._arrive, message, receiver), in_flight=True)

    def _break_connection(self, sender: Sender, receiver: Receiver) -> None:
        if self._blocked(sender.name, receiver.name):
            return
        connection = self._connections.get((sender.name, receiver), _Connection())
        due_ns = max(self.clock.monotonic_ns(), connection.last_arrival_ns)
        due_ns += int(self._link(sender.name, receiver.name).detect_s * 1e9)
        for entity_id in sender.entity_ids():
            lost = Message(Kind.LOST, sender.name, entity_id, incarnation=sender.incarnation)
            self._counters["sent"] += 1
            self._events.push(due_ns, partial(self._arrive, lost, receiver), in_flight=True)

    def _arrive(self, message: Message, receiver: Receiver) -> None:
        with self.lock:
            self._drop_idle_connection(message.sender, receiver)
            fate = self._fate(message, receiver)
            self._counters[fate] += 1
        if fate == "delivered":
            receiver.receive(message)

    def _drop_idle_connection(self, sender: str, receiver: Receiver) -> None:
        connection = self._connections.get((sender, receiver))
        if connection and connection.last_arrival_ns <= self.clock.monotonic_ns():
            del self._connections[sender, receiver]

    def _fate(self, message: Message, receiver: Receiver) -> str:
        if self._receivers.get(receiver.name) is not receiver:
            return "unheard"
        return "blocked" if self._blocked(message.sender, receiver.name) else "delivered"
