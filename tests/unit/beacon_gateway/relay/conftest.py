"""Relays between networks in memory."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.unit.beacon_gateway.relay.plant import Plant, end


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
