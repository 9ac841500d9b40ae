"""How many requests are answered."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING

import attrs
import httpx
import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.access import rate_limit
from beacon_gateway.access.asked import Asked, Refusal
from beacon_gateway.access.options import RateLimitConfig
from beacon_gateway.access.rate_limit import RateLimiter
from beacon_gateway.config import parse_config
from beacon_gateway.http import create_app

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import PlantMaker


@attrs.define
class Desk:
    """A limiter whose time is moved by hand."""

    limiter: RateLimiter
    now_s: list[float]
    told: dict[bytes, bytes] = attrs.field(factory=dict)

    def ask(self, path: str = "/api/v1/apps", client: str = "a") -> Refusal | None:
        headers: list[tuple[bytes, bytes]] = []
        refusal = self.limiter.check(Asked("GET", path, {}, client), headers)
        self.told = dict(headers)
        return refusal

    def passed(self, count: int, path: str = "/api/v1/apps", client: str = "a") -> int:
        return sum(self.ask(path, client) is None for _ in range(count))


def desk(
    *,
    always: dict[str, int] | None = None,
    client_rpm: int = 60,
    global_rpm: int = 600,
    enabled: bool = True,
    endpoints: tuple[str, ...] = (),
) -> Desk:
    now_s = [1000.0]
    config = RateLimitConfig(enabled, client_rpm, global_rpm, endpoints)
    return Desk(RateLimiter(config, always=always, now_s=lambda: now_s[0]), now_s)


def test_a_client_has_a_minute_s_worth_at_once_and_then_one_at_a_time() -> None:
    door = desk(client_rpm=6)
    assert door.passed(10) == 6
    door.now_s[0] += 9.9
    assert door.passed(1) == 0
    door.now_s[0] += 0.1
    assert door.passed(5) == 1
    door.now_s[0] += 3600
    assert door.passed(10) == 6


def test_clients_do_not_draw_from_each_other_but_all_from_one() -> None:
    door = desk(client_rpm=5, global_rpm=8)
    assert door.passed(10, client="a") == 5
    assert door.passed(10, client="b") == 3
    assert door.passed(10, client="c") == 0


def test_what_is_turned_away_takes_nothing_from_the_others() -> None:
    door = desk(client_rpm=5, global_rpm=10)
    door.passed(1000, client="loud")
    assert door.passed(10, client="quiet") == 5


def test_a_client_turned_away_by_all_keeps_its_own() -> None:
    door = desk(client_rpm=5, global_rpm=5)
    door.passed(5, client="a")
    assert door.passed(100, client="b") == 0
    door.now_s[0] += 60
    assert door.passed(10, client="b") == 5


def test_a_path_may_have_a_limit_of_its_own() -> None:
    door = desk(client_rpm=100, endpoints=("/api/v1/apps/*:2",))
    assert door.passed(5, "/api/v1/apps/a") == 2
    assert door.passed(5, "/api/v1/apps/b/") == 0, "one bucket for the pattern"
    assert door.passed(5, "/api/v1/apps") == 5
    assert door.passed(5, "/api/v1/apps/a/data") == 5
    assert door.passed(5, "/api/v1/apps/a", client="b") == 2


def test_every_answer_says_how_much_is_left() -> None:
    door = desk(client_rpm=3)
    door.ask()
    assert (door.told[b"x-ratelimit-limit"], door.told[b"x-ratelimit-remaining"]) == (b"3", b"2")
    assert 19 <= int(door.told[b"x-ratelimit-reset"]) - time.time() <= 21
    door.passed(2)
    assert door.told[b"x-ratelimit-remaining"] == b"0"


def test_whoever_is_turned_away_is_told_when_to_come_back() -> None:
    door = desk(client_rpm=3)
    door.passed(3)
    refusal = door.ask()
    assert refusal is not None
    assert (refusal.status, refusal.code) == (429, "rate-limit-exceeded")
    reset = int(door.told[b"x-ratelimit-reset"])
    assert refusal.parameters == {"retry_after": 20, "limit": 3, "reset": reset}
    assert dict(refusal.headers)[b"retry-after"] == b"20"
    door.now_s[0] += 20
    assert door.ask() is None


def test_disabled_it_limits_nothing_but_what_is_always_limited() -> None:
    door = desk(enabled=False, always={"/auth/*": 2}, global_rpm=1, endpoints=("/x:1",))
    assert door.passed(1000) == 1000
    assert door.passed(10, "/x") == 10
    assert door.told == {}
    assert door.passed(5, "/auth/token") == 2


def test_a_flood_of_addresses_costs_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rate_limit, "MAX_CLIENTS", 10)
    door = desk(client_rpm=1, global_rpm=10**6)
    for number in range(1000):
        assert door.passed(1, client=str(number)) == 1
    assert len(door.limiter._full_at_s) == 10
    assert door.passed(1, client="999") == 0


@pytest.mark.parametrize("entry", ["/a", "a:1", "/a:0", "/a:x", "/a b:1"])
def test_an_override_that_is_none_is_refused(entry: str) -> None:
    with pytest.raises(ConfigError, match=r"^\$.http.rate_limit.endpoints: found"):
        parse_config({"http": {"rate_limit": {"endpoints": [entry]}}})


def test_the_application_answers_429_in_the_form_of_all_errors(make_plant: PlantMaker) -> None:
    plant = make_plant(http={"rate_limit": {"enabled": True, "client_rpm": 2}})
    transport = httpx.ASGITransport(create_app(plant.gateway))

    async def ask() -> list[httpx.Response]:
        async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
            return [await client.get("/api/v1/apps") for _ in range(3)]

    answers = asyncio.run(ask())
    assert [one.headers["x-ratelimit-remaining"] for one in answers] == ["1", "0", "0"]
    assert [one.status_code for one in answers] == [200, 200, 429]
    # Thirty seconds after the last one was due, of which some have passed.
    assert 25 <= int(answers[2].headers["retry-after"]) <= 30
    assert answers[2].json()["error_code"] == "rate-limit-exceeded"
