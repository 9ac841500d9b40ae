"""Relays between networks in memory."""

from __future__ import annotations

import threading
import uuid
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from beacon_gateway.relay.relay import Relay
from beacon_gateway.relay.routes import create_relay_app
from beacon_gateway.server import HttpServer
from tests.unit.beacon_gateway.relay.plant import Plant, end, wait_for


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[Plant]:
    made = Plant(tmp_path)
    with made.opened:
        yield made


@pytest.fixture
def link() -> str:
    """A conduit that no other test has."""
    return f"test-{uuid.uuid4().hex[:12]}"


@pytest.fixture
def one_way(link: str) -> dict[str, Any]:
    """From ``robot`` to ``site``, under ``/robot``."""
    return {
        "robot": end(
            "robot", link, forward=[{"deny": "/secret"}, {"allow": "/**", "to": "/robot/**"}]
        ),
        "site": end("site", link, republish=True),
    }


@pytest.fixture
def served(plant: Plant, one_way: dict[str, Any]) -> Iterator[tuple[Relay, str]]:
    """A relay that has carried three messages and refuses a topic; and where it tells of itself."""
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")
    plant.publisher("robot", "/secret")
    made = plant.relay(one_way)
    wait_for(lambda: bool(made.ends["site"].state().lanes), "the route")
    for _ in range(3):
        talker.publish(b"x")
    wait_for(lambda: len(heard.received()) == 3)
    wait_for(lambda: len(made.ends["robot"].state().routes) == 2, "the refusal")
    with closing(HttpServer("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=server.serve, args=(create_relay_app(made),))
        thread.start()
        yield made, server.url
        server.stop()
        thread.join(5)
