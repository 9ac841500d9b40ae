"""What README.md shows is what happens."""

from __future__ import annotations

import re
import time
from pathlib import Path
from threading import Event

import pytest

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.store import HintStore
from beacon_core.wire import json
from beacon_zenoh import options
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.source import ZenohSource

ROOT = Path(__file__).parents[2]


def readme() -> str:
    path = ROOT / "README.md"
    if not path.exists():
        pytest.skip("README.md is in the source tree only")
    return path.read_text()


def test_announcing_from_python_is_what_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    snippet = snippets()[0]
    endpoint = free_endpoint()
    # The only thing changed is the port, so that tests can run side by side.
    monkeypatch.setattr(options, "DEFAULT_ENDPOINT", endpoint)
    monkeypatch.setattr("beacon_zenoh.config.DEFAULT_ENDPOINT", endpoint)
    store = HintStore(SystemClock())
    source = ZenohSource(ZenohOptions(listen=(endpoint,)))
    source.start(Intake(store, json.decode))
    try:
        announcing, goodbye = snippet.split("...\n")
        names: dict[str, object] = {}
        exec(announcing, names)  # noqa: S102
        wait_for(store, Status.ACTIVE)
        exec(goodbye, names)  # noqa: S102
        wait_for(store, Status.LEFT)
    finally:
        source.close()


def test_announcing_from_a_ros_node_is_what_it_shows() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    from beacon_core.wire import cdr  # noqa: PLC0415 - for this test only
    from beacon_ros.domains import DomainLease  # noqa: PLC0415 - needs rclpy
    from beacon_ros.participant import OwnNode  # noqa: PLC0415
    from beacon_ros_topic.options import RosTopicOptions  # noqa: PLC0415
    from beacon_ros_topic.source import RosTopicSource  # noqa: PLC0415

    store = HintStore(SystemClock())
    with DomainLease() as lease:
        own = OwnNode("readme", lease.domain_id)
        source = RosTopicSource(RosTopicOptions(domain_id=lease.domain_id))
        source.start(Intake(store, cdr.decode))
        try:
            exec(snippets()[1], {"node": own.node})  # noqa: S102
            wait_for(store, Status.ACTIVE)
            own.close()
            wait_for(store, Status.LEFT)
        finally:
            source.close()


def snippets() -> list[str]:
    """The Python blocks of the README, in order."""
    return re.findall(r"```python\n(.*?)```", readme(), re.DOTALL)


def wait_for(store: HintStore, status: Status) -> None:
    deadline = time.monotonic() + 60
    while (stored := store.get("engine_temp")) is None or stored.status is not status:
        assert time.monotonic() < deadline, stored
        Event().wait(0.02)


def test_every_file_it_names_is_there() -> None:
    named = re.findall(r"\]\(([^)#]+)\)", readme())
    assert named
    missing = [name for name in named if "://" not in name and not (ROOT / name).exists()]
    assert missing == []
