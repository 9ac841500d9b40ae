"""What Zenoh or strangers on it can do to a process: never end, never close, lose, flood, forge."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest
import zenoh

from beacon_core.errors import ConfigError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.outcome import Verdict
from beacon_core.ports.health import Condition
from beacon_core.testing.examples import bench_hint
from beacon_core.testing.harness import Harness, Listener
from beacon_core.wire import json
from beacon_zenoh import ADAPTER, ZenohOptions
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import OwnRouterHarness, ZenohHarness
from beacon_zenoh.session import SessionKeeper
from beacon_zenoh.source import ZenohSource

GATEWAY = """
import sys, threading
from beacon_core.outcome import Outcome, Verdict
from beacon_zenoh import ADAPTER, ZenohOptions
class Sink:
    def offer(self, payload, source, **more):
        heard.set()
        return Outcome(Verdict.NEW)
    goodbye = lost = offer
heard = threading.Event()
source = ADAPTER.source(ZenohOptions(listen=(sys.argv[1],)))
source.start(Sink())
assert heard.wait(10)
if sys.argv[2] == "by an exception":
    raise SystemExit(3)
"""

FLOODER = """
import sys, zenoh
from beacon_zenoh import ZenohOptions
from beacon_zenoh.config import session_config
session = zenoh.open(session_config(ZenohOptions(connect=(sys.argv[1],)), "client").make())
print("up", flush=True)
number = 0
while True:
    number += 1
    session.put(f"beacon/hint/flood-{number % 50}", b'{"entity_id": "flood-%d"}' % (number % 50))
"""


@pytest.fixture
def harness() -> Iterator[OwnRouterHarness]:
    """The gateway is the router."""
    made = OwnRouterHarness()
    yield made
    made.close()


@pytest.fixture
def stranger(harness: OwnRouterHarness) -> Iterator[zenoh.Session]:
    """Somebody who speaks Zenoh, but not our dialect. Opened once the router is there."""
    router = Listener(harness).start()
    session = zenoh.open(session_config(harness.options(), "client").make())
    yield session
    close(session)
    router.source.close()


def within(harness: Harness, seconds: float, predicate: Callable[[], bool], what: str) -> None:
    assert harness.wait_until(predicate, seconds), f"not within {seconds} s: {what}"


def close(session: zenoh.Session) -> None:
    session.close()


def flood(endpoint: str) -> subprocess.Popen[bytes]:
    process = subprocess.Popen([sys.executable, "-c", FLOODER, endpoint], stdout=subprocess.PIPE)
    assert process.stdout is not None
    assert process.stdout.readline() == b"up\n"
    return process


def stop(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait(10)
    if process.stdout is not None:
        process.stdout.close()


# Ending


@pytest.mark.parametrize(("how", "code"), [("by running off its end", 0), ("by an exception", 3)])
def test_a_gateway_process_ends_without_close_in_the_middle_of_traffic(
    harness: OwnRouterHarness, how: str, code: int
) -> None:
    (endpoint,) = harness.options().connect
    gateway = subprocess.Popen([sys.executable, "-c", GATEWAY, endpoint, how])
    announcer = harness.announcer(0.001)
    for number in range(20):
        announcer.announce(bench_hint(number))
    try:
        assert gateway.wait(20) == code
    finally:
        gateway.kill()
        gateway.wait()


def test_a_source_closes_within_a_second_in_a_flood(harness: OwnRouterHarness) -> None:
    def closes_in_time(network: int) -> bool:
        listener = Listener(harness, network=network, source_rate=10.0).start()
        flooder = flood(harness.options(network).connect[0])
        try:
            within(harness, 10.0, lambda: len(listener.tap.calls) > 1000, "the flood is on")
            began = time.monotonic()
            listener.source.close()
            took_s = time.monotonic() - began
            heard = len(listener.tap.calls)
            assert not harness.wait_until(lambda: len(listener.tap.calls) > heard, 0.2)
        finally:
            stop(flooder)
        return took_s < 1.0

    # The flood keeps the machine busy, which may hold up one or another.
    assert any(closes_in_time(network) for network in range(3))


def test_a_source_closes_within_a_second_though_its_sink_hangs(harness: OwnRouterHarness) -> None:
    def closes_in_time(network: int) -> bool:
        listener = Listener(harness, network=network).start()
        entered, release = threading.Event(), threading.Event()

        def hang() -> None:
            entered.set()
            release.wait(20)

        listener.tap.hook = hang
        announcer = harness.announcer(network=network)
        for number in range(600):  # more than Zenoh's queue before a callback holds
            announcer.announce(bench_hint(number))
        assert entered.wait(10)
        began = time.monotonic()
        listener.source.close()
        took_s = time.monotonic() - began
        release.set()
        within(harness, 10.0, lambda: len(listener.tap.calls) == 1, "the sink's call ends")
        assert not harness.wait_until(lambda: len(listener.tap.calls) > 1, 0.2)
        return took_s < 1.0

    # It gives up after 0.9 s: a busy machine may add too much to one or another.
    assert any(closes_in_time(network) for network in range(3))


# Many


def test_a_late_source_sees_more_announcers_than_the_queues_of_zenoh_hold() -> None:
    harness = ZenohHarness()
    try:
        strangers = [
            zenoh.open(session_config(harness.options(), "client").make()) for _ in range(3)
        ]
        tokens = [
            session.liveliness().declare_token(f"beacon/live/token-{which}-{number}/run")
            for which, session in enumerate(strangers)
            for number in range(120)
        ]
        announcers = [harness.announcer() for _ in range(40)]
        for number, announcer in enumerate(announcers):
            announcer.announce(bench_hint(number))
        late = Listener(harness).start()
        within(harness, 10.0, lambda: late.store.size() == len(announcers), "all are known")
        count = len(tokens) + len(announcers)
        health = late.source.health
        within(harness, 10.0, lambda: health().counters["tokens"] == count, "all tokens are known")
        for session in strangers:
            close(session)
        left = lambda: health().counters["tokens"] == len(announcers)  # noqa: E731
        within(harness, 10.0, left, "the tokens are gone")
    finally:
        harness.close()


def test_a_router_takes_300_announcers_and_they_all_come_back(harness: OwnRouterHarness) -> None:
    first = Listener(harness).start()
    announcer = harness.announcer()
    for number in range(300):
        announcer.announce(bench_hint(number))
    within(harness, 10.0, lambda: first.store.size() == 300, "all are known")
    first.source.close()
    second = Listener(harness).start()
    within(harness, 10.0, lambda: second.store.size() == 300, "all are known again")
    announcer.close()
    within(harness, 10.0, lambda: second.store.stats().left == 300, "all have left")


# A session that dies


def keeper_of(source: object) -> SessionKeeper:
    assert isinstance(source, ZenohSource)
    return source._keeper


def test_a_session_that_is_found_closed_is_replaced(harness: OwnRouterHarness) -> None:
    listener = Listener(harness).start()
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine"))
    within(harness, 10.0, lambda: listener.has("engine"), "engine is active")
    keeper = keeper_of(listener.source)
    assert keeper._session is not None
    close(keeper._session)
    announcer.announce(BeaconHint("engine", display_name="after"))
    within(harness, 5.0, lambda: listener.says("engine", "after"), "it is heard again")
    health = listener.source.health()
    assert health.condition is Condition.UP
    assert health.counters["sessions-reopened"] == 1


def test_a_client_that_is_without_its_router_for_long_tries_with_a_new_session(
    harness: OwnRouterHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_zenoh.session.STALLED_AFTER_S", 0.3)
    monkeypatch.setattr("beacon_zenoh.session.WATCH_EVERY_S", 0.1)
    first = Listener(harness).start()
    client = Listener(harness).start()
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine"))
    within(harness, 10.0, lambda: client.has("engine"), "engine is active")
    first.source.close()
    reopened = lambda: client.source.health().counters["sessions-reopened"] >= 1  # noqa: E731
    within(harness, 5.0, reopened, "a new session is tried")
    assert client.has("engine", Status.STALE)
    Listener(harness).start()
    within(harness, 5.0, lambda: client.has("engine"), "engine is active again")
    assert client.source.health().condition is Condition.UP


# Strangers


def hears(harness: Harness, listener: Listener, stranger: zenoh.Session) -> None:
    """Wait until the router passes on to it what the stranger puts; until then it is lost."""

    def heard() -> bool:
        stranger.put("beacon/hint/first", json.encode(BeaconHint("first")))
        return listener.has("first")

    within(harness, 10.0, heard, "the stranger is heard")


def test_messages_that_are_not_in_our_dialect_are_counted_and_harm_nobody(
    harness: OwnRouterHarness, stranger: zenoh.Session
) -> None:
    listener = Listener(harness).start()  # a client: it hears what the router passes on
    hears(harness, listener, stranger)

    def counts(what: str, times: int) -> None:
        counted = lambda: listener.source.health().counters[what] == times  # noqa: E731
        within(harness, 5.0, counted, f"{times} {what} are counted")

    payload = json.encode(BeaconHint("engine"))
    for key in ("beacon/**", "beacon/hint/" + "e" * 300):
        stranger.put(key, payload)
    counts("bad-keys", 2)
    for attachment in (b"", b"\x01", b"\x02" + b"x" * 20, b"\xff" * 40, b"\x01" * 5000):
        stranger.put("beacon/hint/engine", payload, attachment=attachment)
    counts("bad-attachments", 5)
    assert listener.has("engine")
    tokens = [
        stranger.liveliness().declare_token(f"beacon/live/{key}")
        for key in ("a b", "a/b/c", "a/" + "i" * 65)
    ]
    counts("bad-keys", 2 + len(tokens))
    stranger.put("beacon/hint/**", payload)
    within(harness, 5.0, lambda: listener.count(Verdict.INVALID) == 1, "no entity is called **")
    stranger.delete("beacon/hint/nobody")
    harness.announcer().announce(BeaconHint("neighbour"))
    within(harness, 5.0, lambda: listener.has("neighbour"), "others are heard")


def test_a_stranger_with_token_and_hint_but_nothing_else_is_a_full_member(
    harness: OwnRouterHarness, stranger: zenoh.Session
) -> None:
    listener = Listener(harness).start()
    hears(harness, listener, stranger)
    stranger.liveliness().declare_token("beacon/live/engine")
    stranger.put("beacon/hint/engine", b'{"entity_id": "engine"}')
    within(harness, 5.0, lambda: listener.has("engine"), "engine is active")
    close(stranger)
    within(harness, 1.0, lambda: listener.has("engine", Status.STALE), "engine is stale")


def test_who_answers_for_others_or_never_does_not_disturb(
    harness: OwnRouterHarness, stranger: zenoh.Session
) -> None:
    held: list[zenoh.Query] = []

    def answer_wrongly(query: zenoh.Query) -> None:
        with query:
            query.reply("beacon/hint/forged", json.encode(BeaconHint("engine")))
            query.reply_err(b"\xff")

    stranger.declare_queryable("beacon/hint/**", held.append, complete=True)
    stranger.declare_queryable("beacon/hint/*", answer_wrongly, complete=True)
    harness.announcer().announce(BeaconHint("engine", display_name="true"))
    late = Listener(harness).start()
    within(harness, 5.0, lambda: late.says("engine", "true"), "engine is known")
    within(harness, 5.0, lambda: late.count(Verdict.INVALID) >= 1, "the forged one is refused")
    began = time.monotonic()
    late.source.close()
    assert time.monotonic() - began < 1.0


def test_a_router_that_cannot_listen_says_which_endpoint_and_what_to_do(
    harness: OwnRouterHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_zenoh.session._FIRST_ATTEMPT_S", 30.0)
    listener = Listener(harness).start()
    options = ZenohOptions(listen=harness.options().connect)
    words = r"^listen: cannot listen at tcp/127\.0\.0\.1:.* in use .* another endpoint$"
    with pytest.raises(ConfigError, match=words):
        ADAPTER.source(options).start(listener.tap)
