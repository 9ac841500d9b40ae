"""Whatever happens: what a client was given first, with the events since, is what there is now."""

from __future__ import annotations

import json
import uuid
from typing import Any

import pytest
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    rule,
)

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_fake import (
    ADAPTER,
    FakeAnnouncer,
    FakeNetwork,
    Kind,
    Message,
    share_network,
    unshare_network,
)
from beacon_gateway.config import parse_config
from beacon_gateway.departures import Witness
from beacon_gateway.gateway import Gateway
from beacon_gateway.live.ring import Ring
from beacon_gateway.live.view import LiveView
from tests.property.running import run

TTLS = {"quick": 1.0, "slow": 10.0, "slower": 25.0}
IDS = ["a", "a", "b", "c", "d"]
WORDS: list[dict[str, Any]] = [
    {},
    {"display_name": "x", "depends_on": ("b", "c")},
    {"hostname": "h1", "process_id": 1},
    {"hostname": "h1", "process_id": 2},
    {"hostname": "h2"},
]
SETTLED = ["entity_id", "type", "href", "status", "restarts", "conflict"]
sources = st.sampled_from(sorted(TTLS))
entity_ids = st.sampled_from(IDS)
words = st.sampled_from(WORDS)


class Client:
    """Applies what it is given, as any client would."""

    def __init__(self, view: LiveView) -> None:
        event = parsed(view.snapshot().data)
        self.rows = {row["entity_id"]: row for row in event["data"]["items"]}
        self.number = int(event["id"].partition("-")[2])

    def read(self, view: LiveView) -> None:
        """All the events since then; anew if they are not kept any more."""
        while (piece := view.ring.after(self.number, 500)) is None or piece[1] > self.number:
            if piece is None:
                view._snapshot = None
                self.__init__(view)  # type: ignore[misc]
                continue
            for text in piece[0].split(b"\n\n")[:-1]:
                self._apply(parsed(text))
            assert self.number == piece[1]

    def _apply(self, event: dict[str, Any]) -> None:
        body = event["data"]
        number = int(event["id"].partition("-")[2])
        assert number == self.number + 1
        self.number = number
        assert event["event"] == body["event_type"]
        if event["event"] == "rejected":
            return
        entity_id = body["x-medkit"]["entity_id"]
        assert body["beacon"]["entity_id"] == entity_id
        known = entity_id in self.rows
        assert known == (event["event"] != "appeared") or event["event"] in {
            "stale",
            "left",
            "conflict",
        }
        if event["event"] == "expired":
            del self.rows[entity_id]
        else:
            self.rows[entity_id] = body["beacon"]


class Machine(RuleBasedStateMachine):
    @initialize(
        frames=st.sampled_from([1, 3, 10_000]),
        looks=st.sampled_from([1, 500]),
        removed=st.sampled_from([1, 10_000]),
    )
    def begin(self, frames: int, looks: int, removed: int) -> None:
        self.patch = pytest.MonkeyPatch()
        self.patch.setattr("beacon_gateway.live.feed._LOOKS", looks)
        self.patch.setattr("beacon_core.register.MAX_REMOVED", removed)
        self.clock = ManualClock()
        run = uuid.uuid4().hex
        self.networks = {name: FakeNetwork(self.clock) for name in TTLS}
        for name, network in self.networks.items():
            share_network(network, name + run)
        documents = {
            name: {
                "adapter": "fake",
                "ttl_s": ttl_s,
                "expiry_s": 3 * ttl_s,
                "max_hints": 3,
                "options": {"network": name + run},
            }
            for name, ttl_s in TTLS.items()
        }
        config = parse_config({"sources": documents}, lambda _: ADAPTER).config
        self.gateway = Gateway(config, lookup=lambda _: ADAPTER, clock=self.clock)
        self.names = [name + run for name in TTLS]
        for listener in self.gateway.listeners:
            listener.source.start(
                Witness(listener.intake, listener.store, listener._note_departure)
            )
        self.announcers: dict[tuple[str, int], FakeAnnouncer] = {}
        self.view = LiveView(self.gateway, Ring(frames=frames))
        self.clients = [Client(self.view)]

    @rule(source=sources, entity_id=entity_ids, said=words, speaker=st.integers(0, 1))
    def announce(self, source: str, entity_id: str, said: dict[str, Any], speaker: int) -> None:
        announcer = self.announcers.get((source, speaker))
        if announcer is None:
            announcer = FakeAnnouncer(self.networks[source], f"r{speaker}")
            self.announcers[source, speaker] = announcer
        announcer.announce(BeaconHint(entity_id, **said))
        self.networks[source].run_until_idle()

    @rule(source=sources, speaker=st.integers(0, 1))
    def repeat(self, source: str, speaker: int) -> None:
        if (source, speaker) in self.announcers:
            for message in self.announcers[source, speaker].present():
                self.networks[source].send(message)
            self.networks[source].run_until_idle()

    @rule(one=sources, other=sources, entity_id=entity_ids, speaker=st.integers(0, 1))
    def outlive(self, one: str, other: str, entity_id: str, speaker: int) -> None:
        """Two sources hear it, one sees it go, the other hears it still."""
        self.announce(one, entity_id, {}, speaker)
        self.wait(0.05)
        self.announce(other, entity_id, {}, speaker)
        self.crash(other, speaker)
        self.look()
        self.wait(0.05)
        self.repeat(one, speaker)

    @rule(source=sources, entity_id=entity_ids, speaker=st.integers(0, 1))
    def withdraw(self, source: str, entity_id: str, speaker: int) -> None:
        if (source, speaker) in self.announcers:
            self.announcers[source, speaker].withdraw(entity_id)
            self.networks[source].run_until_idle()

    @rule(source=sources, speaker=st.integers(0, 1))
    def crash(self, source: str, speaker: int) -> None:
        announcer = self.announcers.pop((source, speaker), None)
        if announcer is not None:
            self.networks[source].crash(announcer.name)
            self.networks[source].run_until_idle()

    @rule(source=sources)
    def talk_nonsense(self, source: str) -> None:
        network = self.networks[source]
        network.send(Message(Kind.HINT, "fool", "a", b"nonsense", 0, "", 0))
        network.run_until_idle()

    @rule(seconds=st.sampled_from([0.05, 0.9, 1.0, 3.0, 10.0, 25.0, 80.0]))
    def wait(self, seconds: float) -> None:
        self.clock.advance(int(seconds * 1e9))
        for network in self.networks.values():
            network.deliver_due()

    @rule(source=sources, entity_id=entity_ids)
    def forget(self, source: str, entity_id: str) -> None:
        listener = next(one for one in self.gateway.listeners if one.name == source)
        listener.store.forget(entity_id)

    @rule()
    def look(self) -> None:
        self.view.advance()

    @rule()
    def another_client(self) -> None:
        if len(self.clients) < 3:
            self.clients.append(Client(self.view))

    @rule()
    def every_client_knows_what_there_is(self) -> None:
        self.view.catch_up()
        now = rows(self.view)
        for client in self.clients:
            client.read(self.view)
            assert {key: timeless(row) for key, row in client.rows.items()} == {
                key: timeless(row) for key, row in now.items()
            }
        for entity_id in IDS:
            self.check(entity_id, now)

    def check(self, entity_id: str, now: dict[str, Any]) -> None:
        beacon = self.gateway.directory.beacon(entity_id)
        assert (beacon is not None) == (entity_id in now)
        if beacon is None:
            return
        row = now[entity_id]
        assert (row["status"], row["conflict"]) == (beacon.status, beacon.conflict)
        assert {one["source"]: one["status"] for one in row["sources"]} == {
            view.source: view.stored.status for view in beacon.views
        }
        # Which of several living ones was heard last is not told.
        spoken = {
            (view.source, view.stored.hint.display_name, view.stored.hint.hostname)
            for view in beacon.views
            if view.stored.status is beacon.status
        }
        told = (row["source"], row.get("display_name", ""), row.get("hostname", ""))
        assert told in spoken

    def teardown(self) -> None:
        if hasattr(self, "gateway"):
            self.every_client_knows_what_there_is()
            self.patch.undo()
            self.gateway.close()
            for name in self.names:
                unshare_network(name)


def parsed(text: bytes) -> dict[str, Any]:
    fields = dict(line.split(": ", 1) for line in text.decode().strip().split("\n"))
    return {**fields, "data": json.loads(fields["data"])}


def rows(view: LiveView) -> dict[str, Any]:
    items = json.loads(view.listing(None, (), full=False))["items"]
    return {row["entity_id"]: row for row in items}


def timeless(row: dict[str, Any]) -> dict[str, Any]:
    """Without the ages; and of several sources only what does not hang on who spoke last."""
    views = sorted(
        ({**view, "age_sec": 0} for view in row["sources"]), key=lambda view: str(view["source"])
    )
    keys = SETTLED if len(views) > 1 else row.keys()
    return {**{key: row[key] for key in keys}, "age_sec": 0, "sources": views}


def test_a_snapshot_and_the_events_since_are_a_later_snapshot() -> None:
    run(Machine, runs=200, steps_per_run=40, seed=0)
