"""Cyclic subscriptions and the stream of faults, over real HTTP where they stream."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator, Callable, Generator, Iterator
from typing import TYPE_CHECKING, Any

import httpx
import pytest
from starlette.types import Message

from beacon_gateway.http import faults, sse, subscription_book

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

SUBSCRIPTIONS = "/api/v1/apps/camera/cyclic-subscriptions"
BEACON = "/api/v1/apps/camera/x-medkit-beacon"
WANTED: dict[str, Any] = {"resource": BEACON, "interval": "fast", "duration": 60}


def subscribe(plant: Plant, **changed: Any) -> dict[str, Any]:
    response = plant.get(SUBSCRIPTIONS, "POST", {**WANTED, **changed})
    assert response.status_code == 201, response.text
    body: dict[str, Any] = response.json()
    return body


def refused(plant: Plant, wanted: object, path: str = SUBSCRIPTIONS) -> tuple[int, str, str]:
    """Status, code and message."""
    response = plant.get(path, "POST", wanted)
    body = response.json()
    return response.status_code, body.get("vendor_code") or body["error_code"], body["message"]


def events(client: httpx.Client, path: str) -> Generator[dict[str, Any], None, None]:
    with client.stream("GET", path, timeout=10) as response:
        assert response.status_code == 200
        assert response.headers["content-type"].startswith("text/event-stream")
        assert response.headers["cache-control"] == "no-cache"
        assert response.headers["x-accel-buffering"] == "no"
        for line in response.iter_lines():
            if line.startswith("data: "):
                yield json.loads(line.removeprefix("data: "))


@pytest.fixture
def client(heard: Plant, serve: Callable[[Plant], str]) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=serve(heard)) as made:
        yield made


# A life


def test_a_subscription_is_made_read_changed_and_ended(heard: Plant) -> None:
    made = subscribe(heard)
    assert made == {
        "id": "sub_001",
        "observed_resource": BEACON,
        "event_source": f"{SUBSCRIPTIONS}/sub_001/events",
        "protocol": "sse",
        "interval": "fast",
    }
    one = f"{SUBSCRIPTIONS}/sub_001"
    assert heard.get(one).json() == made
    assert subscribe(heard)["id"] == "sub_002"
    assert [each["id"] for each in heard.get(SUBSCRIPTIONS).json()["items"]] == [
        "sub_001",
        "sub_002",
    ]
    changed = heard.get(one, "PUT", {"interval": "slow"})
    assert (changed.status_code, changed.json()["interval"]) == (200, "slow")
    ended = heard.get(one, "DELETE")
    assert (ended.status_code, ended.content) == (204, b"")
    for method in ("GET", "DELETE"):
        assert heard.get(one, method).json() == {
            "error_code": "resource-not-found",
            "message": "Subscription not found",
            "parameters": {"subscription_id": "sub_001"},
        }


def test_a_subscription_belongs_to_its_entity(mixed: Plant) -> None:
    wanted = {**WANTED, "resource": "/api/v1/apps/planner/data/status"}
    made = mixed.get("/api/v1/apps/planner/cyclic-subscriptions", "POST", wanted)
    assert made.status_code == 201
    for path in ("/apps/lidar", "/components/ecu"):
        assert mixed.ok(f"{path}/cyclic-subscriptions") == {"items": []}
        assert mixed.refused(f"{path}/cyclic-subscriptions/sub_001")[0] == 404


def test_it_expires_and_can_be_prolonged(heard: Plant) -> None:
    subscribe(heard, duration=10)
    heard.wait(9)
    assert heard.get(f"{SUBSCRIPTIONS}/sub_001", "PUT", {"duration": 10}).status_code == 200
    heard.wait(9)
    assert heard.get(f"{SUBSCRIPTIONS}/sub_001").status_code == 200
    heard.wait(1)
    assert heard.get(f"{SUBSCRIPTIONS}/sub_001").status_code == 404
    assert heard.get(SUBSCRIPTIONS).json() == {"items": []}


def test_there_is_a_cap_and_what_ends_makes_room(
    heard: Plant, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(subscription_book, "MAX_SUBSCRIPTIONS", 2)
    subscribe(heard)
    subscribe(heard, duration=5)
    status, code, _ = refused(heard, WANTED)
    assert (status, code) == (503, "service-unavailable")
    heard.wait(6)
    subscribe(heard)


# Refusals


@pytest.mark.parametrize(
    ("changed", "code", "message"),
    [
        ({"protocol": "mqtt"}, "x-medkit-unsupported-protocol", "Protocol is not available"),
        ({"protocol": 1}, "invalid-parameter", "Invalid protocol"),
        ({"interval": "warp"}, "invalid-parameter", "Invalid interval. Must be"),
        ({"interval": ["fast"]}, "invalid-parameter", "Invalid interval. Must be"),
        ({"interval": None}, "invalid-parameter", "Invalid interval. Must be"),
        ({"duration": 0}, "invalid-parameter", "Duration must be a positive"),
        ({"duration": True}, "invalid-parameter", "Duration must be a positive"),
        ({"duration": 1.5}, "invalid-parameter", "Duration must be a positive"),
        ({"duration": 3601}, "invalid-parameter", "Duration must not exceed 3600"),
        ({"resource": 7}, "invalid-parameter", "Invalid resource"),
        ({"resource": "x"}, "x-medkit-invalid-resource-uri", "Invalid resource URI"),
        ({"resource": "/api/v1/apps/camera"}, "x-medkit-invalid-resource-uri", "Invalid"),
        ({"resource": f"{BEACON}/../data"}, "x-medkit-invalid-resource-uri", "Invalid"),
        ({"resource": "/api/v1/apps/camera/odd"}, "x-medkit-invalid-resource-uri", "Unknown"),
        ({"resource": "/api/v1/apps/camera/data"}, "x-medkit-invalid-resource-uri", "Data"),
        ({"resource": f"{BEACON}/status"}, "x-medkit-invalid-resource-uri", "This collection"),
        (
            {"resource": "/api/v1/apps/lidar/x-medkit-beacon"},
            "x-medkit-entity-mismatch",
            "Resource URI must reference the same entity",
        ),
        (
            {"resource": "/api/v1/components/camera/x-medkit-beacon"},
            "x-medkit-entity-mismatch",
            "Resource URI must reference the same entity",
        ),
        (
            {"resource": "/api/v1/apps/camera/faults"},
            "x-medkit-collection-not-available",
            "Nothing is sent",
        ),
        (
            {"resource": "/api/v1/apps/camera/x-medkit-topic-beacon"},
            "x-medkit-collection-not-available",
            "Nothing is sent",
        ),
    ],
)
def test_each_thing_wrong_has_one_clear_error(
    heard: Plant, changed: dict[str, Any], code: str, message: str
) -> None:
    status, found, said = refused(heard, {**WANTED, **changed})
    assert (status, found) == (400, code)
    assert said.startswith(message)


def test_nothing_of_a_function_can_be_observed(mixed: Plant) -> None:
    wanted = {**WANTED, "resource": "/api/v1/functions/drive/x-medkit-beacon"}
    path = "/api/v1/functions/drive/cyclic-subscriptions"
    assert refused(mixed, wanted, path)[1] == "x-medkit-collection-not-available"


def test_a_body_that_is_none_is_refused(heard: Plant, serve: Callable[[Plant], str]) -> None:
    assert refused(heard, [1])[1:] == ("invalid-request", "Request body is not a JSON object")
    with httpx.Client(base_url=serve(heard)) as client:
        for content, status, message in (
            (b"", 400, "Request body is not JSON"),
            (b"{", 400, "Request body is not JSON"),
            (b'"' + b"a" * 70_000 + b'"', 413, "Request body too large"),
        ):
            response = client.post(SUBSCRIPTIONS, content=content)
            assert response.status_code == status
            assert response.json()["message"].startswith(message)


@pytest.mark.parametrize(
    ("given", "message"),
    [({"interval": "warp"}, "Invalid interval"), ({"duration": -1}, "Duration must be")],
)
def test_a_change_that_cannot_be_is_refused_and_changes_nothing(
    heard: Plant, given: dict[str, Any], message: str
) -> None:
    made = subscribe(heard)
    response = heard.get(f"{SUBSCRIPTIONS}/sub_001", "PUT", given)
    assert response.status_code == 400
    assert response.json()["message"].startswith(message)
    assert heard.get(f"{SUBSCRIPTIONS}/sub_001").json() == made


# Events


def test_the_resource_is_sent_again_and_again_as_it_is_then(
    heard: Plant, client: httpx.Client
) -> None:
    made = client.post(SUBSCRIPTIONS, json=WANTED).json()
    stream = events(client, made["event_source"])
    first = next(stream)
    assert first["timestamp"] == "2023-11-14T22:13:20.000Z"
    assert first["payload"]["entity_id"] == "camera"
    assert first["payload"]["status"] == "active"
    heard.wait(11)
    assert any(event["payload"]["status"] == "stale" for event in stream)
    stream.close()


def test_a_single_field_can_be_observed(client: httpx.Client) -> None:
    wanted = {**WANTED, "resource": "/api/v1/apps/camera/data/hostname"}
    made = client.post(SUBSCRIPTIONS, json=wanted).json()
    assert next(events(client, made["event_source"]))["payload"]["value"] == "h"


def test_so_can_what_one_carrier_heard(
    make_plant: PlantMaker, serve: Callable[[Plant], str]
) -> None:
    endpoint = "x-medkit-topic-beacon"
    plant = make_plant(sources={"near": {"adapter": "topic"}}, endpoints={"topic": endpoint})
    plant.announce("camera", source="near", hostname="h")
    with httpx.Client(base_url=serve(plant)) as client:
        wanted = {**WANTED, "resource": f"/api/v1/apps/camera/{endpoint}"}
        made = client.post(SUBSCRIPTIONS, json=wanted).json()
        payload = next(events(client, made["event_source"]))["payload"]
    assert len(payload) == 14


def test_what_cannot_be_sent_is_told_as_an_error_and_may_come_back(
    heard: Plant, client: httpx.Client
) -> None:
    made = client.post(SUBSCRIPTIONS, json={**WANTED, "duration": 3600}).json()
    stream = events(client, made["event_source"])
    assert "payload" in next(stream)
    heard.wait(400)
    error = next(event["error"] for event in stream if "error" in event)
    assert (error["error_code"], error["message"]) == (
        "entity-not-found",
        "App not found: camera",
    )
    heard.announce("camera")
    assert any("payload" in event for event in stream)
    stream.close()


def test_a_stream_ends_with_its_subscription(heard: Plant, client: httpx.Client) -> None:
    made = client.post(SUBSCRIPTIONS, json=WANTED).json()
    stream = events(client, made["event_source"])
    next(stream)
    heard.clock.advance(61 * 10**9)
    assert sum(1 for _ in stream) < 100


def test_streams_end_when_the_gateway_stops(heard: Plant, client: httpx.Client) -> None:
    made = client.post(SUBSCRIPTIONS, json=WANTED).json()
    stream = events(client, made["event_source"])
    next(stream)
    heard.gateway.stopping.set()
    assert sum(1 for _ in stream) < 100


def test_there_is_no_stream_of_what_is_not_there(heard: Plant) -> None:
    response = heard.get(f"{SUBSCRIPTIONS}/sub_001/events")
    assert (response.status_code, response.json()["message"]) == (404, "Subscription not found")


# Faults


def test_on_the_stream_of_faults_nothing_happens_but_it_lives(
    heard: Plant, client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faults, "KEEPALIVE_S", 0.01)
    with client.stream("GET", "/api/v1/faults/stream", timeout=10) as response:
        assert response.headers["content-type"] == "text/event-stream"
        lines = response.iter_lines()
        assert [next(lines) for _ in range(4)] == [":keepalive", "", ":keepalive", ""]
        heard.gateway.stopping.set()
        assert set(lines) <= {":keepalive", ""}


def test_a_head_request_for_a_stream_does_not_wait(client: httpx.Client) -> None:
    response = client.head("/api/v1/faults/stream")
    assert (response.status_code, response.content) == (200, b"")


def test_one_stream_too_many_is_refused_and_a_place_is_free_again(
    make_plant: PlantMaker, serve: Callable[[Plant], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faults, "MAX_STREAMS", 1)
    with httpx.Client(base_url=serve(make_plant())) as client:
        with client.stream("GET", "/api/v1/faults/stream") as response:
            lines = response.iter_lines()
            assert next(lines) == ":keepalive"
            refused_ = client.get("/api/v1/faults/stream")
            assert refused_.status_code == 503
            assert refused_.json()["parameters"] == {"max_streams": 1}
        response = client.head("/api/v1/faults/stream")
        while response.status_code == 503:
            response = client.head("/api/v1/faults/stream")


def test_a_client_that_takes_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sse, "STUCK_S", 0.05)
    ended: list[str] = []

    async def pieces() -> AsyncGenerator[bytes, None]:
        try:
            while True:
                yield b":keepalive\n\n"
        finally:
            ended.append("the source too")

    async def never() -> Message:
        await asyncio.Event().wait()
        raise AssertionError

    async def send(message: Message) -> None:
        if message["type"] == "http.response.body":
            await never()

    places = sse.Places(1)
    response = sse.EventResponse(pieces(), places)
    asyncio.run(asyncio.wait_for(response({"method": "GET"}, never, send), 5))
    assert ended == ["the source too"]
    with places.one():
        pass
