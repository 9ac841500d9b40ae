"""An answer that is kept for a moment hides no change."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

import httpx
import pytest
from starlette.responses import PlainTextResponse
from starlette.routing import Mount
from starlette.types import Receive, Scope, Send

from beacon_gateway.http import snapshots
from beacon_gateway.http.shortcut import Shortcut
from beacon_gateway.http.snapshots import LONGEST_NS, Snapshots
from beacon_gateway.tree.entities import App, Tree
from beacon_gateway.tree.manifest import Manifest

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant


def test_within_a_moment_an_answer_is_given_again_and_then_made_anew(heard: Plant) -> None:
    kept = Snapshots(heard.gateway)
    assert kept.get("a") is None
    assert kept.make("a", lambda: b"one") == b"one"
    assert kept.get("a") == b"one"
    assert kept.get("b") is None
    heard.clock.advance(LONGEST_NS)
    assert kept.get("a") == b"one"
    heard.clock.advance(1)
    assert kept.get("a") is None


def test_any_change_in_a_store_ends_it(heard: Plant) -> None:
    kept = Snapshots(heard.gateway)
    kept.make("a", lambda: b"one")
    heard.announce("lidar", display_name="Other")
    assert kept.get("a") is None


def test_what_falls_due_ends_it_at_that_very_moment(heard: Plant) -> None:
    kept = Snapshots(heard.gateway)
    store = heard.gateway.listeners[0].store
    due_ns = store.next_deadline_ns()
    assert due_ns is not None
    heard.clock.advance(due_ns - heard.clock.monotonic_ns() - 2)
    kept.make("a", lambda: b"one")
    heard.clock.advance(1)
    assert kept.get("a") == b"one"
    heard.clock.advance(1)
    assert kept.get("a") is None


def test_an_answer_that_cannot_be_made_is_not_kept(heard: Plant) -> None:
    kept = Snapshots(heard.gateway)

    def fails() -> bytes:
        raise LookupError

    with pytest.raises(LookupError):
        kept.make("a", fails)
    assert kept.get("a") is None


def test_what_is_kept_is_bounded(heard: Plant, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(snapshots, "MAX_BYTES", 10)
    kept = Snapshots(heard.gateway)
    kept.make("a", lambda: b"12345")
    kept.make("b", lambda: b"12345")
    assert kept.get("a") == b"12345"
    kept.make("c", lambda: b"1")
    assert (kept.get("a"), kept.get("b"), kept.get("c")) == (None, None, b"1")


def test_what_is_made_anew_takes_the_room_of_what_it_replaces(
    heard: Plant, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(snapshots, "MAX_BYTES", 10)
    kept = Snapshots(heard.gateway)
    kept.make("a", lambda: b"12345")
    for _ in range(3):
        kept.make("b", lambda: b"12345")
    assert (kept.get("a"), kept.get("b")) == (b"12345", b"12345")
    kept.make("b", lambda: b"1")
    kept.make("c", lambda: b"1234")
    assert (kept.get("a"), kept.get("b"), kept.get("c")) == (b"12345", b"1", b"1234")
    kept.make("d", lambda: b"1")
    assert (kept.get("a"), kept.get("d")) == (None, b"1")


def test_another_manifest_ends_it(heard: Plant) -> None:
    kept = Snapshots(heard.gateway)
    kept.make("a", lambda: b"one")
    heard.gateway.directory.take_manifest(Manifest(Tree(apps={"new": App("new")})))
    assert kept.get("a") is None


def test_what_is_kept_of_one_path_and_mount_is_given_for_no_other(heard: Plant) -> None:
    async def routes(scope: Scope, receive: Receive, send: Send) -> None:
        await PlainTextResponse("from the routes")(scope, receive, send)

    kept = Snapshots(heard.gateway)
    kept.make(("", "/a"), lambda: b"kept")
    mounted = Mount("/robots", app=Shortcut(routes, kept))

    async def ask() -> list[str]:
        at_root = Shortcut(routes, kept)
        asked: list[tuple[str, str, Shortcut | Mount]] = [
            ("GET", "/a", at_root),
            ("POST", "/a", at_root),
            ("GET", "/b", at_root),
            ("GET", "/robots/a", mounted),
        ]
        answers = []
        for method, path, served in asked:
            transport = httpx.ASGITransport(served)
            async with httpx.AsyncClient(transport=transport, base_url="http://gateway") as client:
                answers.append((await client.request(method, path)).text)
        return answers

    assert asyncio.run(ask()) == ["kept", *["from the routes"] * 3]


def test_ages_go_on_and_a_change_of_status_is_seen_at_once(heard: Plant) -> None:
    first = heard.ok("/apps/lidar/x-medkit-beacon")["age_sec"]
    heard.wait(0.5)
    assert heard.ok("/apps/lidar/x-medkit-beacon")["age_sec"] == pytest.approx(first + 0.5)
    heard.wait(9.4)
    assert heard.ok("/apps/lidar/x-medkit-beacon")["status"] == "active"
    heard.wait(0.2)
    assert heard.ok("/apps/lidar/x-medkit-beacon")["status"] == "stale"
    assert heard.ok("/apps")["items"][0]["x-medkit"]["is_online"] is False
