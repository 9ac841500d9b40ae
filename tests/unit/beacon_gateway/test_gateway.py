"""The gateway at work: starting, sweeping, closing; faults of adapters stay theirs."""

from __future__ import annotations

import threading
import time
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest

from beacon_core.clock import SystemClock
from beacon_core.errors import ConfigError
from beacon_core.hint import BeaconHint
from beacon_core.outcome import Verdict
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_core.wire import json
from beacon_fake import ADAPTER as FAKE
from beacon_gateway.config import parse_config, read_manifest
from beacon_gateway.gateway import Gateway

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker


@attrs.frozen
class Options:
    fault: str = ""


class Faulty:
    """A source with the faults asked for."""

    made: list[Faulty]

    def __init__(self, options: Options) -> None:
        if options.fault == "made":
            raise ConfigError("no such device")
        self.fault = options.fault
        self.sink: HintSink | None = None
        self.closed = 0
        self.released = threading.Event()
        Faulty.made.append(self)

    def start(self, sink: HintSink) -> None:
        if self.fault == "start":
            raise ConfigError("the device is in use")
        self.sink = sink

    def close(self) -> None:
        self.closed += 1
        if self.fault == "close":
            raise RuntimeError("does not close")
        if self.fault == "hang":
            self.released.wait(30)

    def health(self) -> Health:
        return Health(Condition.UP)


@pytest.fixture(autouse=True)
def _fresh() -> None:
    Faulty.made = []


def gateway(*faults: str, **settings: Any) -> Gateway:
    def no_announcer(*_: object) -> Any:
        raise NotImplementedError

    def lookup(name: str) -> Adapter:
        return Adapter(name, Options, json.decode, Faulty, no_announcer)

    sources = {
        f"s{number}": {"adapter": "faulty", "options": {"fault": fault}, **settings}
        for number, fault in enumerate(faults)
    }
    return Gateway(parse_config({"sources": sources}, lookup).config, lookup=lookup)


def eventually(true: Any, within_s: float = 5.0) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_each_source_has_a_store_and_a_ttl_of_its_own(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"fast": {"ttl_s": 1}, "slow": {"ttl_s": 100}})
    plant.announce("a", source="fast")
    plant.announce("b", source="slow")
    fast, slow = plant.gateway.listeners
    plant.wait(2)
    assert (fast.store.stats().stale, slow.store.stats().stale) == (1, 0)
    assert (fast.store.stats().active, slow.store.stats().active) == (0, 1)


def test_the_configured_limits_reach_the_core(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"s": {"max_hints": 2, "source_rate": 3, "expiry_s": 30}})
    announcer = plant.announcer("robot", "s")
    for number in range(10):
        announcer.announce(BeaconHint(f"a{number}"))
    plant.settle()
    (listener,) = plant.gateway.listeners
    assert listener.store.size() == 2
    assert listener.intake.totals()[Verdict.SOURCE_RATE] == 7
    assert listener.store.expiry_ns == 30 * 10**9


def test_a_source_that_cannot_be_made_is_named_by_its_place() -> None:
    with pytest.raises(ConfigError, match=r"^\$\.sources\.s1: no such device$"):
        gateway("", "made")


def test_if_one_source_cannot_start_none_is_left_open() -> None:
    made = gateway("", "start", "")
    with pytest.raises(ConfigError, match=r"^\$\.sources\.s1: the device is in use$"):
        made.start()
    assert [source.closed for source in Faulty.made] == [1, 1, 1]


class Asking(Faulty):
    """A source that asks, and must know whom."""

    targets: frozenset[str] | None = None

    def set_targets(self, nodes: frozenset[str] | None) -> None:
        assert self.sink is None, "told too late: it has been started"
        self.targets = nodes


def told(*apps: dict[str, str], source: type[Faulty] = Asking) -> frozenset[str] | None:
    """Whom a source is told to ask, of a gateway with these apps."""

    def lookup(name: str) -> Adapter:
        return attrs.evolve(FAKE, name=name, options=Options, source=source)

    document = {"sources": {"s": {"adapter": "asking"}}, "entities": {"apps": list(apps)}}
    made = Gateway(parse_config(document, lookup).config, lookup=lookup)
    made.start()
    made.close()
    (asking,) = Faulty.made
    return getattr(asking, "targets", None)


def test_a_source_that_asks_is_told_the_nodes_of_the_apps() -> None:
    apps = [{"id": "a", "ros_node": "/arm/driver"}, {"id": "b"}, {"id": "c", "ros_node": "/c"}]
    assert told(*apps) == frozenset({"/arm/driver", "/c"})


def test_where_no_app_names_its_node_the_source_finds_out_by_itself() -> None:
    assert told({"id": "a"}) is None


class AskingAndSeeing(Asking):
    """It sees the ROS graph too, which the test fills."""

    def __init__(self, options: Options) -> None:
        super().__init__(options)
        self.seen: frozenset[str] = frozenset()

    def set_targets(self, nodes: frozenset[str] | None) -> None:
        self.targets = nodes

    def nodes(self) -> frozenset[str]:
        return self.seen


def test_whom_to_ask_follows_the_manifest_and_the_graph(tmp_path: Path) -> None:
    def lookup(name: str) -> Adapter:
        return attrs.evolve(FAKE, name=name, options=Options, source=AskingAndSeeing)

    (tmp_path / "manifest.yaml").write_text(
        'manifest_version: "1.0"\n'
        "apps:\n"
        "  - {id: a, ros_binding: {node_name: driver, namespace: /arm}}\n"
        "  - {id: b, ros_binding: {node_name: planner, namespace: '*'}}\n"
    )
    document = {
        "sources": {"s": {"adapter": "asking", "ttl_s": 0.1}},
        "manifest": "manifest.yaml",
        "entities": {"apps": [{"id": "c", "ros_node": "/c"}]},
    }
    config = parse_config(document, lookup, folder=tmp_path).config
    with closing(Gateway(config, lookup=lookup)) as made:
        (asking,) = Faulty.made
        assert isinstance(asking, AskingAndSeeing)
        made.start()
        assert asking.targets is None
        asking.seen = frozenset({"/arm/driver", "/up/planner", "/other"})
        eventually(lambda: asking.targets == {"/arm/driver", "/up/planner", "/c"})
        asking.seen = frozenset()
        eventually(lambda: asking.targets is None)
        (tmp_path / "manifest.yaml").write_text('manifest_version: "1.0"\n')
        made.take_config(config, read_manifest(config))
        assert asking.targets == {"/c"}


def test_a_source_that_listens_is_not_told_whom_to_ask() -> None:
    assert told({"id": "a", "ros_node": "/a"}, source=Faulty) is None


def test_close_is_idempotent_and_closes_every_source_though_one_fails() -> None:
    made = gateway("close", "")
    made.start()
    made.close()
    made.close()
    assert [source.closed for source in Faulty.made] == [2, 2]


def test_close_is_bounded_though_an_adapter_hangs() -> None:
    made = gateway("hang", "")
    made.start()
    began = time.monotonic()
    made.close()
    assert time.monotonic() - began < 10.0
    Faulty.made[0].released.set()


def test_close_before_start_and_without_start_is_harmless() -> None:
    made = gateway("")
    made.close()


def test_the_sweeper_settles_what_falls_due_though_nobody_asks() -> None:
    made = gateway("", ttl_s=0.1, expiry_s=1.0)
    made.start()
    sink = Faulty.made[0].sink
    assert sink is not None
    store = made.listeners[0].store
    sink.offer(json.encode(BeaconHint("a")), "somebody")
    began = SystemClock.monotonic_ns()
    # `revision` and `next_deadline_ns` do not settle anything themselves.
    eventually(lambda: store.revision >= 2)
    assert SystemClock.monotonic_ns() - began >= 0.09e9
    eventually(lambda: store.revision >= 3)
    assert SystemClock.monotonic_ns() - began >= 0.9e9
    made.close()


def test_the_sweeper_rests_while_nothing_falls_due(monkeypatch: pytest.MonkeyPatch) -> None:
    made = gateway("", ttl_s=0.3)
    sweeps: list[int] = []
    store = made.listeners[0].store
    sweep = store.sweep

    def counted() -> int:
        sweeps.append(1)
        return sweep()

    monkeypatch.setattr(store, "sweep", counted)
    made.start()
    eventually(lambda: len(sweeps) >= 2)
    # Twice the shortest ttl has passed, and no more was done than to look again.
    assert SystemClock.monotonic_ns() - made.started_ns >= 0.5e9
    made.close()


def test_a_listing_holds_together_while_entities_come_and_go(plant: Plant) -> None:
    """Whoever looks at any moment sees an entity that is always there, in one state or another."""
    stop = threading.Event()

    def come_and_go() -> None:
        process_id = 0
        while not stop.is_set():
            process_id += 1
            announcer = plant.announce("robot", process_id=process_id)
            announcer.close()
            plant.settle()

    plant.announce("robot", process_id=99)
    thread = threading.Thread(target=come_and_go)
    thread.start()
    try:
        for _ in range(300):
            assert list(plant.gateway.directory.tree().apps) == ["robot"]
    finally:
        stop.set()
        thread.join()
