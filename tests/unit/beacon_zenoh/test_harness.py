"""The harness's own parts: the child's orders, and a port that is taken under one's hands."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition, Health
from beacon_core.wire import json as wire
from beacon_zenoh import ADAPTER, ZenohOptions, harness


class Said:
    """An announcer that writes down what it is told."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def announce(self, hint: BeaconHint) -> None:
        self.words.append(f"announce {hint.entity_id}")

    def withdraw(self, entity_id: str) -> None:
        self.words.append(f"withdraw {entity_id}")

    def close(self) -> None:
        self.words.append("close")

    def health(self) -> Health:
        return Health(Condition.UP)


ORDERS = [
    json.dumps(["announce", wire.encode(BeaconHint("engine")).decode()]),
    json.dumps(["withdraw", "engine"]),
]


def test_a_child_obeys_and_vanishes_at_the_end_of_its_orders() -> None:
    announcer = Said()
    harness._obey(announcer, ORDERS)
    assert announcer.words == ["announce engine", "withdraw engine"]


def test_an_interrupted_child_says_goodbye() -> None:
    def orders() -> Iterator[str]:
        yield ORDERS[0]
        raise KeyboardInterrupt

    announcer = Said()
    harness._obey(announcer, orders())
    assert announcer.words == ["announce engine", "close"]


def test_a_process_is_up_until_it_has_ended() -> None:
    announcer = harness.ProcessAnnouncer(ZenohOptions(connect=(harness.free_endpoint(),)))
    assert announcer.health().condition is Condition.UP
    announcer.end(signal.SIGKILL)
    assert announcer.health().condition is Condition.CLOSED


def test_a_router_takes_another_port_if_its_own_was_taken_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, taken = harness.open_router()
    free = harness.free_endpoint()
    endpoints = [free, taken]
    monkeypatch.setattr(harness, "free_endpoint", endpoints.pop)
    second, endpoint = harness.open_router(ZenohOptions(prefix="other"))
    assert endpoint == free
    for session in (first, second):
        session.close()


def test_the_first_source_is_the_router_until_it_is_closed() -> None:
    made = harness.OwnRouterHarness()
    first, second = made.source(), made.source()
    assert made.source(1) is not first
    first.close()
    third = made.source()
    modes = [one._keeper.config.mode for one in (first, second, third)]  # type: ignore[attr-defined]
    assert modes == ["router", "client", "router"]
    made.close()


def test_it_is_a_harness_of_the_adapter() -> None:
    assert harness.ZenohHarness().adapter is ADAPTER
