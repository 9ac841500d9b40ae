"""Networks, and relays between them: as many as wanted, on conduits that do as they are told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from beacon_core.relay.effects import (
    Arm,
    CreatePublisher,
    DestroyPublisher,
    Effect,
    Publish,
    Send,
    Subscribe,
    Unsubscribe,
)
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.frames import KIND_AT, Kind
from beacon_core.relay.republisher import Republisher
from beacon_fake.conduit import FakeConduit

MS = 10**6
_RESET = int(Kind.RESET)


class Sender:
    """A forwarder in one of its lives, and what it has subscribed."""

    def __init__(self, core: Forwarder) -> None:
        self.core = core
        self.due: int | None = None
        self.subscribed: dict[str, Subscribe] = {}


class Receiver:
    """A republisher in one of its lives, and its publishers."""

    def __init__(self, core: Republisher) -> None:
        self.core = core
        self.due: int | None = None
        self.publishers: dict[int, CreatePublisher] = {}


class End:
    """Between a network and a conduit; with one core or both, which may be replaced."""

    def __init__(self, name: str, network: str, conduit: str) -> None:
        self.name, self.network, self.conduit = name, network, conduit
        self.inbox = FakeConduit()
        self.sender: Sender | None = None
        self.receiver: Receiver | None = None
        self.effects: list[Effect] = []
        """All that its cores ever asked for."""


@attrs.frozen
class Published:
    """By a relay, on a network."""

    at_ns: int
    end: str
    network: str
    topic: str
    payload: bytes


class Net:
    """All that happens, happens when it is said to; frames wait in the inbox of who is to hear."""

    def __init__(self, *, tells: bool, matches: bool = True) -> None:
        """``tells``: a network says who took a message first, and how far it has come.

        ``matches``: publishers match at once.
        """
        self.now = 1_000_000 * MS
        self.ends: dict[str, End] = {}
        self.tells, self.matches = tells, matches
        self.topics: dict[tuple[str, str], SeenTopic] = {}
        # By network and name: those that somebody else than a relay publishes.
        self.published: list[Published] = []
        self.loses: Callable[[Send], bool] = lambda _: False
        self.heard: Callable[[End, CreatePublisher, Publish], None] = lambda *_: None

    # -- ends

    def add(self, name: str, network: str, conduit: str) -> End:
        end = self.ends[name] = End(name, network, conduit)
        return end

    def send_by(self, end: End, core: Forwarder) -> None:
        """Have the end send by this core from now on."""
        end.sender = Sender(core)
        self.tell_sender(end, "link_up")
        for topic, seen in self.seen_by(end).items():
            self.tell_sender(end, "topic_seen", topic, seen)

    def receive_by(self, end: End, core: Republisher) -> None:
        """Have it receive by this core; the publishers of the one before are gone."""
        gone = end.receiver.publishers if end.receiver else {}
        end.receiver = Receiver(core)
        for one in gone.values():
            self.tell_of(end.network, one.topic)
        self.tell_receiver(end, "link_up")

    def seen_by(self, end: End) -> dict[str, SeenTopic]:
        """The topics that have publishers other than its own."""
        seen = {t: one for (network, t), one in self.topics.items() if network == end.network}
        for other in self.ends.values():
            if other is not end and other.network == end.network and other.receiver:
                for one in other.receiver.publishers.values():
                    seen.setdefault(one.topic, SeenTopic(one.type, one.qos))
        return seen

    # -- what happens

    def topic(self, network: str, topic: str, seen: SeenTopic | None) -> None:
        """Somebody publishes it, of this kind; or nobody but relays does any more."""
        if seen is None:
            self.topics.pop((network, topic), None)
        else:
            self.topics[network, topic] = seen
        self.tell_of(network, topic)

    def tell_of(self, network: str, topic: str) -> None:
        for end in self.ends.values():
            if end.network == network and end.sender:
                seen = self.seen_by(end).get(topic)
                if seen is not None:
                    self.tell_sender(end, "topic_seen", topic, seen)
                elif topic in end.sender.subscribed:
                    self.tell_sender(end, "topic_gone", topic)

    def publish(
        self,
        network: str,
        topic: str,
        payload: bytes,
        *,
        by: End | None = None,
        first: int = 0,
        hop: int = 0,
    ) -> None:
        """A message on a network, of somebody or of a relay."""
        for end in self.ends.values():
            if end.network == network and end is not by and end.sender:
                subscribe = end.sender.subscribed.get(topic)
                if subscribe is not None:
                    self.message(end, subscribe, payload, first, hop)

    def message(self, end: End, subscribe: Subscribe, payload: bytes, first: int, hop: int) -> None:
        assert end.sender is not None
        core = end.sender.core
        self.carry_out(
            end, core.message(subscribe.handle, payload, self.now, first=first, hop=hop), end.sender
        )

    def deliver(self, end: End, at: int = 0, *, keep: bool = False) -> None:
        """A frame reaches an end."""
        frame = end.inbox.take(at, keep=keep)
        if frame is None:
            return
        if frame.header[KIND_AT] == _RESET:
            if end.sender:
                self.tell_sender(end, "frame", frame.header, frame.payload)
        elif end.receiver:
            self.tell_receiver(end, "frame", frame.header, frame.payload)

    def flow(self) -> None:
        """All frames get through, and what follows from them."""
        for _ in range(100_000):
            waiting = [end for end in self.ends.values() if len(end.inbox)]
            if not waiting:
                return
            for end in waiting:
                self.deliver(end)
        raise AssertionError("they never stop talking")

    def pass_time(self, ns: int, *, flowing: bool = True) -> None:
        until = self.now + ns
        for _ in range(100_000):
            if flowing:
                self.flow()
            self.now = max(self.now, min([until, *self.dues()]))
            self.tick()
            if self.now >= until:
                return
        raise AssertionError("time stands still")

    def dues(self) -> list[int]:
        sides = [one for end in self.ends.values() for one in (end.sender, end.receiver)]
        return [one.due for one in sides if one is not None and one.due is not None]

    def tick(self) -> None:
        for end in self.ends.values():
            if end.sender and end.sender.due is not None and end.sender.due <= self.now:
                self.tell_sender(end, "tick")
                assert end.sender.due is None or end.sender.due > self.now
            if end.receiver and end.receiver.due is not None and end.receiver.due <= self.now:
                self.tell_receiver(end, "tick")
                assert end.receiver.due is None or end.receiver.due > self.now

    # -- what is to be done

    def tell_sender(self, end: End, method: str, *args: Any) -> None:
        assert end.sender is not None
        self.carry_out(end, getattr(end.sender.core, method)(*args, self.now), end.sender)

    def tell_receiver(self, end: End, method: str, *args: Any) -> None:
        assert end.receiver is not None
        self.carry_out(end, getattr(end.receiver.core, method)(*args, self.now), end.receiver)

    def carry_out(self, end: End, effects: list[Effect], side: Sender | Receiver) -> None:
        end.effects += effects
        for effect in effects:
            match effect:
                case Send():
                    self.spread(end, effect)
                case Arm():
                    side.due = effect.due_ns
                case Publish():
                    assert isinstance(side, Receiver)
                    self.out(end, side.publishers[effect.handle], effect)
                case _:
                    self.arrange(end, effect, side)

    def arrange(self, end: End, effect: Effect, side: Sender | Receiver) -> None:
        if isinstance(side, Sender):
            match effect:
                case Subscribe():
                    side.subscribed[effect.topic] = effect
                case Unsubscribe():
                    for topic, one in list(side.subscribed.items()):
                        if one.handle == effect.handle:
                            del side.subscribed[topic]
            return
        match effect:
            case CreatePublisher():
                side.publishers[effect.handle] = effect
                self.tell_of(end.network, effect.topic)
                if self.matches and effect.handle in side.publishers:
                    self.tell_receiver(end, "matched", effect.handle, 1, 1)
            case DestroyPublisher():
                self.tell_of(end.network, side.publishers.pop(effect.handle).topic)

    def spread(self, end: End, effect: Send) -> None:
        if self.loses(effect):
            return
        for other in self.ends.values():
            if other is not end and other.conduit == end.conduit:
                other.inbox.send(effect.header, effect.payload)

    def out(self, end: End, publisher: CreatePublisher, effect: Publish) -> None:
        self.heard(end, publisher, effect)
        self.published.append(
            Published(self.now, end.name, end.network, publisher.topic, effect.payload)
        )
        first, hop = (effect.first, effect.hop) if self.tells else (0, 0)
        self.publish(end.network, publisher.topic, effect.payload, by=end, first=first, hop=hop)
