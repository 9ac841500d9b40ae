"""docs/adapters/zenoh_rmw.md does what it says."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import attrs
import pytest

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.store import HintStore
from beacon_core.testing.harness import Listener
from beacon_core.wire import json
from beacon_zenoh.rmw import RmwOptions
from beacon_zenoh.rmw.harness import RmwHarness
from beacon_zenoh.rmw_param import RmwParamOptions
from beacon_zenoh.rmw_param.source import RmwParamSource

PAGE = (Path(__file__).parents[2] / "docs/adapters/zenoh_rmw.md").read_text("utf-8")


@pytest.fixture
def harness() -> Iterator[RmwHarness]:
    made = RmwHarness()
    yield made
    made.close()


def test_its_python_comes_and_leaves(harness: RmwHarness) -> None:
    listener = Listener(harness).start()
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    code = "".join(blocks).replace("tcp/127.0.0.1:7447", harness.endpoint)
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, timeout=30, capture_output=True, text=True
    )
    assert harness.wait_until(lambda: listener.has("engine", Status.LEFT), 5.0)
    assert done.stdout == "[]\n"


def test_its_options_are_all_there_are() -> None:
    table = PAGE.partition("## Options")[2].partition("With `namespaces`")[0]
    named = set(re.findall(r"`(\w+)`", "".join(re.findall(r"^\| (.*?) \|", table, re.MULTILINE))))
    assert named == {field.name for field in attrs.fields(RmwOptions)}


def test_its_counters_are_all_there_are(harness: RmwHarness) -> None:
    table = PAGE.partition("## When nothing shows")[2].partition("## How")[0]
    cells = "".join(re.findall(r"^\| (.*?) \|", table, re.MULTILINE))
    named = set(re.findall(r"`([\w-]+)`", cells))
    assert named == set(harness.source().health().counters)


def test_the_options_and_counters_of_asking_are_all_there_are() -> None:
    section = PAGE.partition("## Parameters")[2].partition("\n## ")[0]
    tables = "".join(re.findall(r"^\| (.*?) \|", section, re.MULTILINE))
    named = set(re.findall(r"`([\w-]+)`", tables))
    shared = {field.name for field in attrs.fields(RmwOptions)}
    options = {field.name for field in attrs.fields(RmwParamOptions)} - shared
    source = RmwParamSource(RmwParamOptions(connect=("tcp/127.0.0.1:1",)))
    source.start(Intake(HintStore(SystemClock()), json.decode))
    counters = set(source.health().counters)
    source.close()
    assert named - {"entity_id", "ttl_s"} == options | counters
