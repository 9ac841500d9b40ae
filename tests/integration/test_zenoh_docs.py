"""docs/adapters/zenoh.md does what it says: its Python runs, its recipes are the ones we test."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import attrs
import pytest

from beacon_core.lifecycle import Status
from beacon_core.testing.harness import Listener
from beacon_zenoh import ZenohOptions
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import OwnRouterHarness

PAGE = Path(__file__).parents[2] / "docs/adapters/zenoh.md"


def blocks(language: str) -> list[str]:
    found = re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    return [str(block) for block in found]


@pytest.fixture
def harness() -> Iterator[OwnRouterHarness]:
    made = OwnRouterHarness()
    yield made
    made.close()


@pytest.mark.parametrize(("number", "entity_id"), [(0, "engine"), (1, "brake")])
def test_its_python_comes_and_leaves(
    harness: OwnRouterHarness, number: int, entity_id: str
) -> None:
    listener = Listener(harness).start()
    (endpoint,) = harness.options().connect
    code = blocks("python")[number].replace("tcp/127.0.0.1:7447", endpoint)
    subprocess.run([sys.executable, "-c", code], check=True, timeout=30)
    assert harness.wait_until(lambda: listener.has(entity_id, Status.LEFT), 5.0)
    calls = listener.tap.calls
    assert all(call.incarnation for call in calls)
    # On a busy machine the end of its connection may be told before its goodbye, by another thread.
    said = [call for call in calls if call.kind != "lost"]
    assert [call.kind for call in said[-2:]] == ["offer", "goodbye"]
    assert all(call.sequence for call in said)
    assert listener.source.health().counters["bad-attachments"] == 0


def test_its_defaults_are_ours() -> None:
    rows = re.findall(
        r"^\| `([a-z_/]+)`(?:, `\w+`)? \| ([\w.]+)", PAGE.read_text("utf-8"), re.MULTILINE
    )
    said = {key: value for key, value in rows if "/" in key}
    config = session_config(ZenohOptions(), "router").make()
    for key in ("transport/link/tx/lease", "transport/unicast/max_sessions", "scouting/delay"):
        assert said[key] == config.get_json(key)
    for key in ("scouting/multicast/enabled", "scouting/gossip/enabled"):
        assert said[key] == config.get_json(key) == "false"
    assert said["transport/shared_memory/enabled"] == "false"
    assert said["transport/link/tx/queue/size/data"] == config.get_json(
        "transport/link/tx/queue/size/data"
    )


def test_its_options_are_all_there_are() -> None:
    table = PAGE.read_text("utf-8").partition("## Options")[2].partition("Later ones override")[0]
    named = set(re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (.*?) \|", table, re.MULTILINE))))
    assert named == {field.name for field in attrs.fields(ZenohOptions)}
