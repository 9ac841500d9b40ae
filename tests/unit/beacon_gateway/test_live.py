"""The live view: who is told what, over HTTP, and how it ends."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any, Protocol

import attrs
import httpx
import pytest

from beacon_core.hint import BeaconHint
from beacon_gateway.live.hub import Hub
from beacon_gateway.live.ring import Frame, Ring
from beacon_gateway.live.stream import EventStream
from beacon_gateway.live.view import LiveView
from beacon_gateway.tree.entities import App, Component, Tree
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.writing import to_json

PATH = "/api/v1/x-medkit-beacon"


class Plant(Protocol):
    clock: Any
    gateway: Any
    networks: Any

    def announce(self, entity_id: str, *, source: str = ..., **fields: Any) -> Any: ...
    def wait(self, seconds: float) -> None: ...
    def settle(self) -> None: ...
    def ok(self, path: str) -> dict[str, Any]: ...
    def get(self, path: str, method: str = ...) -> httpx.Response: ...
    def refused(self, path: str) -> tuple[int, dict[str, Any]]: ...


@attrs.define
class Reader:
    """A client on the other side of the ASGI interface: it decides when it takes anything."""

    got: asyncio.Queue[bytes]
    reads: asyncio.Event
    leave: asyncio.Event
    text: str = ""
    ended: bool = False

    async def event(self, kind: str) -> dict[str, Any]:
        """The next event of this kind; comments and others are passed over."""
        while True:
            while "\n\n" not in self.text:
                assert not (self.ended and self.got.empty()), f"the stream ended before {kind}"
                self.text += (await asyncio.wait_for(self.got.get(), 10)).decode()
            one, _, self.text = self.text.partition("\n\n")
            fields = dict(line.split(": ", 1) for line in one.split("\n") if ": " in line)
            if fields.get("event") == kind:
                return {"id": fields.get("id", ""), **json.loads(fields["data"])}


@asynccontextmanager
async def reading(hub: Hub, revision: str = "") -> AsyncIterator[Reader]:
    reader = Reader(asyncio.Queue(), asyncio.Event(), asyncio.Event())
    reader.reads.set()

    async def receive() -> dict[str, Any]:
        await reader.leave.wait()
        return {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        await reader.reads.wait()
        reader.got.put_nowait(message.get("body", b""))
        if message["type"] == "http.response.body" and not message.get("more_body"):
            reader.ended = True

    stream = EventStream(hub, revision)
    scope: dict[str, Any] = {"type": "http", "method": "GET"}
    task = asyncio.ensure_future(stream(scope, receive, send))
    try:
        yield reader
        reader.leave.set()
        reader.reads.set()
        await asyncio.wait_for(task, 10)
    finally:
        task.cancel()


def hub_of(plant: Plant, *, ring: Ring | None = None, max_clients: int = 10) -> Hub:
    return Hub(LiveView(plant.gateway, ring), plant.gateway.stopping, max_clients=max_clients)


def test_first_comes_everything_then_each_change(plant: Plant) -> None:
    async def scene() -> None:
        plant.announce("old", display_name="Old one", depends_on=("new",))
        async with reading(hub_of(plant)) as reader:
            snapshot = await reader.event("snapshot")
            assert snapshot["id"] == snapshot["revision"]
            assert [row["entity_id"] for row in snapshot["items"]] == ["old"]
            assert snapshot["items"][0]["depends_on"] == ["new"]
            assert snapshot["sources"] == [
                {
                    "name": "robots",
                    "adapter": "fake",
                    "ttl_sec": 10.0,
                    "expiry_sec": 300.0,
                    "max_hints": 10_000,
                }
            ]
            robot = plant.announce("new", hostname="h", process_id=7, component_id="ecu")
            event = await reader.event("appeared")
            assert event["x-medkit"] == {"entity_type": "app", "entity_id": "new"}
            row = event["beacon"]
            assert row | {"age_sec": 0} == {
                "entity_id": "new",
                "type": "app",
                "href": "/api/v1/apps/new",
                "source": "robots",
                "status": "active",
                "age_sec": 0,
                "cause": "heard",
                "restarts": 0,
                "conflict": False,
                "ttl_sec": 10.0,
                "expiry_sec": 300.0,
                "sources": [{**row["sources"][0]}],
                "component_id": "ecu",
                "hostname": "h",
                "process_id": 7,
            }
            robot.withdraw("new")
            plant.settle()
            assert (await reader.event("left"))["beacon"]["status"] == "left"

    asyncio.run(scene())


def test_apps_that_are_known_beforehand_are_named_heard_or_not(
    make_plant: Callable[..., Plant],
) -> None:
    async def scene() -> None:
        known = [{"id": "planner", "name": "Planner"}, {"id": "arm"}]
        plant = make_plant(entities={"apps": known, "components": [{"id": "ecu"}]})
        plant.announce("arm")
        plant.announce("stranger")
        async with reading(hub_of(plant)) as reader:
            snapshot = await reader.event("snapshot")
            expected = {one["entity_id"]: one for one in snapshot["expected"]}
            assert expected.keys() == {"planner", "arm"}
            assert expected["planner"] == {
                "entity_id": "planner",
                "type": "app",
                "href": "/api/v1/apps/planner",
                "display_name": "Planner",
                "depends_on": [],
            }

    asyncio.run(scene())


def test_others_that_are_expected_after_a_reload_are_told_to_everybody(
    make_plant: Callable[..., Plant],
) -> None:
    async def scene() -> None:
        plant = make_plant(entities={"apps": [{"id": "planner", "name": "Planner"}]})
        hub = hub_of(plant)
        async with reading(hub) as reader:
            revision = (await reader.event("snapshot"))["revision"]
            apps = {one: App(one) for one in ("arm", "crane")}
            plant.gateway.take_config(plant.gateway.config, Manifest(Tree(apps=apps)))
            event = await reader.event("expected")
            assert [one["entity_id"] for one in event["expected"]] == ["arm", "crane"]
            assert event["x-medkit"] == {"entity_type": "gateway", "entity_id": ""}
            plant.announce("arm")
            assert (await reader.event("appeared"))["x-medkit"]["entity_id"] == "arm"
        async with reading(hub, revision) as reader:
            assert len((await reader.event("expected"))["expected"]) == 2

    asyncio.run(scene())


def test_whom_another_manifest_has_elsewhere_is_told_of_at_once(
    make_plant: Callable[..., Plant],
) -> None:
    async def scene() -> None:
        plant = make_plant(allow_new_entities=False, entities={"apps": [{"id": "bystander"}]})
        plant.announce("ecu")
        bystander = plant.announce("bystander")
        view = LiveView(plant.gateway)
        async with reading(hub_of(plant)) as reader:
            (before,) = [
                one
                for one in (await reader.event("snapshot"))["items"]
                if one["entity_id"] == "ecu"
            ]
            assert (before["type"], "href" in before) == ("app", False)
            known = Tree(apps={"bystander": App("bystander")}, components={"ecu": Component("ecu")})
            plant.gateway.take_config(plant.gateway.config, Manifest(known))
            await reader.event("expected")
            event = await reader.event("updated")
            row = event["beacon"]
            assert (row["entity_id"], row["type"]) == ("ecu", "component")
            assert row["href"] == "/api/v1/components/ecu"
            assert event["x-medkit"] == {"entity_type": "component", "entity_id": "ecu"}
            # Nobody else has moved, and nobody is told of twice.
            bystander.announce(BeaconHint("bystander", display_name="News"))
            plant.settle()
            assert (await reader.event("updated"))["beacon"]["entity_id"] == "bystander"
        since = view.ring.last
        view.catch_up()
        asked = json.loads(view.listing(since, (), full=False))
        assert {one["entity_id"] for one in asked["items"]} == {"ecu", "bystander"}

    asyncio.run(scene())


def test_the_whole_life_of_an_entity_is_told(plant: Plant) -> None:
    async def scene() -> None:
        async with reading(hub_of(plant)) as reader:
            await reader.event("snapshot")
            plant.announce("a", hostname="h", process_id=1)
            await reader.event("appeared")
            plant.wait(10)
            assert (await reader.event("stale"))["beacon"]["cause"] == "silent"
            plant.announce("a", hostname="h", process_id=2)
            restarted = await reader.event("restarted")
            recovered = await reader.event("recovered")
            assert restarted["beacon"]["restarts"] == recovered["beacon"]["restarts"] == 1
            assert restarted["beacon"]["process_id"] == recovered["beacon"]["process_id"] == 2
            plant.announce("a", hostname="elsewhere")
            assert (await reader.event("conflict"))["beacon"]["conflict"] is True
            plant.wait(301)
            plant.wait(301)
            assert (await reader.event("expired"))["beacon"]["entity_id"] == "a"

    asyncio.run(scene())


def test_a_mere_refresh_is_told_where_it_outweighs_what_another_source_saw(
    make_plant: Callable[..., Plant],
) -> None:
    async def scene() -> None:
        plant = make_plant(sources={"one": {}, "two": {}})
        living = plant.announce("a", source="one", hostname="h", process_id=1)
        plant.wait(1)
        lost = plant.announce("a", source="two", hostname="h", process_id=1)
        async with reading(hub_of(plant)) as reader:
            await reader.event("snapshot")
            plant.networks["two"].crash(lost.name)
            plant.settle()
            plant.wait(1)
            assert (await reader.event("stale"))["beacon"]["source"] == "two"
            for message in living.present():
                plant.networks["one"].send(message)
            plant.settle()
            assert (await reader.event("recovered"))["beacon"]["source"] == "one"

    asyncio.run(scene())


def test_what_was_refused_is_told_as_a_sum_at_most_once_per_second(plant: Plant) -> None:
    async def scene() -> None:
        async with reading(hub_of(plant)) as reader:
            await reader.event("snapshot")
            intake = plant.gateway.listeners[0].intake
            for _ in range(5):
                intake.offer(b"no hint", "fool")
            plant.wait(1)
            event = await reader.event("rejected")
            assert event["x-medkit"] == {"entity_type": "source", "entity_id": "robots"}
            assert event["rejected"]["count"] == 5
            [reason] = event["rejected"]["reasons"]
            assert (reason["verdict"], reason["count"], reason["sender"]) == (
                "malformed",
                5,
                "fool",
            )
            assert "not JSON" in reason["detail"]
            intake.offer(b"no hint", "fool")
            plant.announce("a")
            number = int((await reader.event("appeared"))["id"].partition("-")[2])
            plant.wait(1)
            event = await reader.event("rejected")
            assert event["rejected"]["count"] == 1
            assert int(event["id"].partition("-")[2]) == number + 1

    asyncio.run(scene())


def test_who_was_away_reads_on_where_it_stopped(plant: Plant) -> None:
    async def scene() -> None:
        hub = hub_of(plant)
        async with reading(hub) as reader:
            await reader.event("snapshot")
            plant.announce("a")
            seen = (await reader.event("appeared"))["id"]
        plant.announce("b")
        hub.view.catch_up()
        async with reading(hub, seen) as reader:
            first = await asyncio.wait_for(reader.got.get(), 10)
            assert first == b""
            assert (await reader.event("appeared"))["beacon"]["entity_id"] == "b"

    asyncio.run(scene())


@pytest.mark.parametrize("revision", ["", "nonsense", "00000000-0", "{epoch}-99", "{epoch}-x"])
def test_who_stopped_nobody_knows_where_gets_everything(plant: Plant, revision: str) -> None:
    async def scene() -> None:
        hub = hub_of(plant)
        epoch = hub.view.revision(0).partition("-")[0]
        async with reading(hub, revision.format(epoch=epoch)) as reader:
            await reader.event("snapshot")

    asyncio.run(scene())


def test_one_that_falls_behind_is_dropped_with_a_reason_and_nobody_else(plant: Plant) -> None:
    async def scene() -> None:
        hub = hub_of(plant, ring=Ring(frames=5))
        async with reading(hub) as slow, reading(hub) as quick:
            await slow.event("snapshot")
            await quick.event("snapshot")
            slow.reads.clear()
            for number in range(12):
                plant.announce(f"e{number}")
                await quick.event("appeared")
            slow.reads.set()
            assert "too slow" in (await slow.event("dropped"))["reason"]
            assert slow.ended
            assert sum(hub.dropped.values()) == 1
            plant.announce("last")
            await quick.event("appeared")

    asyncio.run(scene())


def test_one_that_takes_nothing_is_given_up(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("beacon_gateway.live.stream.STUCK_S", 0.05)

    async def scene() -> None:
        hub = hub_of(plant)
        async with reading(hub) as reader:
            await reader.event("snapshot")
            reader.reads.clear()
            plant.announce("a")
            async with asyncio.timeout(10):
                while not hub.dropped:  # noqa: ASYNC110
                    await asyncio.sleep(0.01)
            assert "took nothing" in next(iter(hub.dropped))

    asyncio.run(scene())


def test_a_silent_stream_is_kept_alive(plant: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("beacon_gateway.live.hub.KEEPALIVE_S", 0.05)

    async def scene() -> None:
        async with reading(hub_of(plant)) as reader:
            await reader.event("snapshot")
            assert await asyncio.wait_for(reader.got.get(), 10) == b":keepalive\n\n"

    asyncio.run(scene())


def test_everybody_is_told_when_the_gateway_stops(plant: Plant) -> None:
    async def scene() -> None:
        async with reading(hub_of(plant)) as reader:
            await reader.event("snapshot")
            plant.gateway.stopping.set()
            assert (await reader.event("end"))["reason"] == "the gateway is stopping"
            assert reader.ended

    asyncio.run(scene())


def test_a_server_without_patience_lets_it_be_told_all_the_same(plant: Plant) -> None:
    async def scene() -> None:
        hub, sent = hub_of(plant), asyncio.Queue[Any]()

        async def receive() -> Any:
            await asyncio.Event().wait()

        stream = EventStream(hub, "")
        task = asyncio.ensure_future(stream({"type": "http", "method": "GET"}, receive, sent.put))
        while b"snapshot" not in (await sent.get()).get("body", b""):
            pass
        task.cancel()
        await asyncio.wait({task})
        assert b"event: end" in (await sent.get())["body"]

    asyncio.run(scene())


def test_one_client_too_many_is_told_when_to_come_back(plant: Plant) -> None:
    async def scene() -> None:
        hub, sent = hub_of(plant, max_clients=1), list[Any]()
        async with reading(hub):
            await asyncio.sleep(0)
            assert hub.count == 1

            async def send(message: Any) -> None:
                sent.append(message)

            scope: dict[str, Any] = {"type": "http", "method": "GET"}
            await EventStream(hub, "")(scope, None, send)  # type: ignore[arg-type]
            assert sent[0]["status"] == 503
            assert (b"retry-after", b"10") in sent[0]["headers"]
            assert json.loads(sent[1]["body"])["error_code"] == "service-unavailable"
        assert hub.count == 0

    asyncio.run(scene())


def test_a_fault_in_looking_ends_nobodys_stream(
    plant: Plant, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def scene() -> None:
        hub = hub_of(plant)
        advance = hub.view.advance
        faults = iter([RuntimeError("a defect")])

        def fail_once() -> None:
            for fault in faults:
                raise fault
            advance()

        monkeypatch.setattr(hub.view, "advance", fail_once)
        async with reading(hub) as reader:
            await reader.event("snapshot")
            plant.announce("a")
            await reader.event("appeared")

    asyncio.run(scene())
    assert "trying again" in caplog.text


def test_the_headers_are_those_of_a_stream(plant: Plant) -> None:
    answer = plant.get(f"{PATH}/stream", "HEAD")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/event-stream; charset=utf-8"
    assert answer.headers["cache-control"] == "no-cache"
    assert answer.headers["x-accel-buffering"] == "no"


def test_the_listing_has_everything_or_what_has_changed(
    plant: Plant, serve: Callable[[Plant], str]
) -> None:
    url = serve(plant) + PATH
    plant.announce("a")
    robot = plant.announce("b")
    first = httpx.get(url).json()
    assert first["complete"] is True
    assert [row["entity_id"] for row in first["items"]] == ["a", "b"]
    assert first["x-medkit"] == {"total_count": 2}
    later = httpx.get(url, params={"since": first["revision"]}).json()
    assert (later["complete"], later["items"], later["gone"]) == (False, [], [])
    assert later["revision"] == first["revision"]
    robot.withdraw("b")
    plant.settle()
    plant.announce("a", display_name="new name")
    later = httpx.get(url, params={"since": first["revision"]}).json()
    assert {row["entity_id"]: row["status"] for row in later["items"]} == {
        "a": "active",
        "b": "left",
    }
    plant.wait(10)
    gone = httpx.get(url, params={"since": later["revision"]}).json()
    assert gone["gone"] == ["b"]
    assert [row["entity_id"] for row in gone["items"]] == ["a"]
    assert httpx.get(url, params={"since": "another-run-7"}).json()["complete"] is True


def test_the_listing_waits_for_news(plant: Plant, serve: Callable[[Plant], str]) -> None:
    url = serve(plant) + PATH
    since = httpx.get(url).json()["revision"]
    timer = threading.Timer(0.2, plant.announce, ["a"])
    timer.start()
    news = httpx.get(url, params={"since": since, "wait": "20"}, timeout=15).json()
    timer.join()
    assert [row["entity_id"] for row in news["items"]] == ["a"]
    quiet = httpx.get(url, params={"since": news["revision"], "wait": "0.05"}).json()
    assert (quiet["items"], quiet["revision"]) == ([], news["revision"])


@pytest.mark.parametrize("wait", ["soon", "-1", "nan", "inf"])
def test_a_wait_that_is_no_time_is_refused(plant: Plant, wait: str) -> None:
    status, body = plant.refused(f"/x-medkit-beacon?wait={wait}")
    assert (status, body["error_code"]) == (400, "invalid-parameter")


def test_one_entity_can_be_asked_for_in_full(plant: Plant) -> None:
    plant.announce("a", hostname="h1", metadata={"k": "v"})
    plant.announce("b")
    plant.announce("a", hostname="h2")
    body = plant.ok("/x-medkit-beacon?id=a&id=unknown&full=true")
    [row] = body["items"]
    assert row["sources"][0]["hint"]["metadata"] == {"k": "v"}
    assert row["sources"][0]["history"] == []
    assert [claim["hostname"] for claim in row["claims"]] == ["h1", "h2"]
    assert body["x-medkit"] == {"total_count": 2}


def test_an_entity_the_tree_does_not_take_in_has_no_address(
    make_plant: Callable[..., Plant],
) -> None:
    plant = make_plant(allow_new_entities=False)
    plant.announce("stranger")
    [row] = plant.ok("/x-medkit-beacon")["items"]
    assert "href" not in row


def test_what_is_no_text_can_be_sent_all_the_same() -> None:
    assert to_json({"reason": "half \ud800"}) == b'{"reason":"half ?"}'


def test_the_ring_forgets_the_oldest_by_number_and_by_bytes() -> None:
    ring = Ring(frames=3, size=100)
    for number in range(1, 6):
        ring.append(Frame(number, f"e{number}", b"%d" % number))
    assert not ring.reaches(1)
    assert ring.reaches(2)
    assert not ring.reaches(6)
    assert ring.after(1, 10) is None
    assert ring.entities_after(1) is None
    assert ring.after(2, 2) == (b"34", 4)
    assert ring.after(4, 2) == (b"5", 5)
    assert ring.after(5, 2) == (b"", 5)
    assert ring.entities_after(3) == ["e4", "e5"]
    ring.append(Frame(6, "big", b"x" * 200))
    assert ring.after(5, 2) == (b"x" * 200, 6)
    assert not ring.reaches(4)
    assert ring.near(6)
    assert not ring.near(5)
