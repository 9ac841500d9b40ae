"""An end tells its cores what happens, and does what they ask for."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import pytest

from beacon_core.clock import SystemClock
from beacon_core.ports.conduit import ConduitLimits, FrameSink
from beacon_core.ports.topic_side import TopicWatcher
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import RouteState, SeenTopic
from beacon_core.relay.frames import Content, Reset, decode, encode
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.values import Qos, TopicType
from beacon_gateway.relay.end import End
from tests.unit.beacon_gateway.relay.plant import SOON_S, wait_for

KIND = TopicType("std_msgs/msg/String", "RIHS01_1")
ALL = NameMap((Rule(allow=True, pattern="/**"),))


class Wire:
    """A conduit that keeps what it is given."""

    def __init__(self) -> None:
        self.sent: list[tuple[bytes, bytes]] = []
        self.sink: FrameSink | None = None
        self.refuses = False

    def start(self, sink: FrameSink) -> None:
        if self.refuses:
            raise RuntimeError("no such conduit")
        self.sink = sink

    def send(self, header: bytes, payload: bytes) -> bool:
        self.sent.append((header, payload))
        return True

    def limits(self) -> ConduitLimits:
        return ConduitLimits(2**20, 2**20)

    def close(self) -> None:
        self.sink = None

    def frames(self, kind: type[Any]) -> list[Any]:
        return [one for one in (decode(*sent) for sent in self.sent) if isinstance(one, kind)]


class Network:
    """A topic side that keeps what it is asked."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.watcher: TopicWatcher | None = None
        self.broken = ""

    def start(self, watcher: TopicWatcher) -> None:
        self.watcher = watcher

    def close(self) -> None:
        self.asked.append("close")

    def __getattr__(self, name: str) -> Callable[..., None]:
        def asked(*_: object) -> None:
            self.asked.append(name)
            if name == self.broken:
                raise RuntimeError("it broke")

        return asked


class Bench:
    def __init__(self, *, forwards: bool = True, republishes: bool = False) -> None:
        self.wire, self.network = Wire(), Network()
        clock = SystemClock()
        now_ns = clock.monotonic_ns()
        self.end = End(
            "bench",
            self.network,
            self.wire,
            clock,
            forwarder=Forwarder(origin=7, epoch=1, names=ALL, now_ns=now_ns) if forwards else None,
            republisher=Republisher(asker=9, now_ns=now_ns) if republishes else None,
        )
        self.end.start()

    @property
    def watcher(self) -> TopicWatcher:
        assert self.network.watcher is not None
        return self.network.watcher

    @property
    def sink(self) -> FrameSink:
        assert self.wire.sink is not None
        return self.wire.sink


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> Any:
    made: list[Bench] = []

    def make(**named: bool) -> Bench:
        made.append(Bench(**named))
        return made[-1]

    yield make
    for one in made:
        one.end.close()


def test_a_message_that_comes_from_the_network_is_sent(bench: Any) -> None:
    one = bench()
    one.sink.link(up=True)
    one.watcher.topic_seen("/a", SeenTopic(KIND))
    assert one.network.asked == ["subscribe"]
    one.watcher.message(1, b"x", stamp_ns=5)
    assert [frame.payload for frame in one.wire.frames(Content)] == [b"x"]
    one.watcher.topic_gone("/a")
    assert one.network.asked == ["subscribe", "unsubscribe"]


def test_what_is_due_is_done_when_it_is(bench: Any) -> None:
    one = bench(forwards=False, republishes=True)
    one.sink.link(up=True)
    wait_for(lambda: len(one.wire.frames(Reset)) >= 2, "the second hello")


def test_its_state_is_that_of_both_its_cores(bench: Any) -> None:
    one = bench(republishes=True)
    assert not one.end.state().linked
    one.sink.link(up=True)
    one.watcher.topic_seen("/a", SeenTopic(KIND))
    one.watcher.message(1, b"x")
    state = one.end.state()
    assert state.linked
    assert (state.forwarder.entered, state.republisher.entered) == (1, 0)
    assert [route.state for route in state.routes] == [RouteState.OPEN]
    one.sink.link(up=False)
    assert not one.end.state().linked


def test_a_reset_is_the_forwarders_and_all_else_the_republishers(bench: Any) -> None:
    one = bench(republishes=True)
    one.sink.frame(*encode(Reset(99, 1, 3)))
    one.sink.frame(*encode(Content(8, 1, 1, 0, 0, b"", 8)))
    one.sink.frame(b"", b"")
    state = one.end.state()
    assert state.forwarder.foreign == 1
    assert (state.republisher.frames.unjoined, state.republisher.frames.malformed) == (1, 1)


def test_what_only_the_other_kind_of_core_would_want_is_counted_all_the_same(bench: Any) -> None:
    one, other = bench(), bench(forwards=False, republishes=True)
    one.sink.frame(*encode(Content(8, 1, 1, 0, 0, b"", 8)))
    other.sink.frame(*encode(Reset(99, 1, 3)))
    assert one.end.state().forwarder.foreign == 1
    assert other.end.state().republisher.frames.foreign == 1


def test_a_topic_is_explained_with_the_rule_and_what_became_of_it(bench: Any) -> None:
    one = bench()
    one.watcher.topic_seen("/a", SeenTopic(KIND))
    found = one.end.explain("/a")
    assert found.ruling.allowed
    assert [route.topic for route in found.routes] == ["/a"]
    assert bench(forwards=False, republishes=True).end.explain("/a") is None


def test_what_one_effect_breaks_the_others_need_not_suffer(
    bench: Any, caplog: pytest.LogCaptureFixture
) -> None:
    one = bench()
    one.sink.link(up=True)
    one.network.broken = "subscribe"
    with caplog.at_level(logging.ERROR):
        one.watcher.topic_seen("/a", SeenTopic(KIND, Qos()))
    assert "Subscribe was not carried out" in caplog.text
    # The advertisement came after it.
    assert one.wire.frames(Content) == []
    assert len(one.wire.sent) == 2


def test_an_end_that_cannot_begin_is_closed() -> None:
    wire, network = Wire(), Network()
    wire.refuses = True
    one = End("bench", network, wire, SystemClock())
    with pytest.raises(RuntimeError, match="no such conduit"):
        one.start()
    assert network.asked == ["close"]
    assert not [thread for thread in threading.enumerate() if thread.name == "relay-bench-waker"]


def test_many_threads_may_tell_it_things_at_once(bench: Any) -> None:
    one = bench()
    one.sink.link(up=True)
    one.watcher.topic_seen("/a", SeenTopic(KIND))

    def tell() -> None:
        for _ in range(300):
            one.watcher.message(1, b"x")

    threads = [threading.Thread(target=tell) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(SOON_S)
    assert one.end.state().forwarder.entered == 1200
    assert [frame.seq for frame in one.wire.frames(Content)] == list(range(1200))
