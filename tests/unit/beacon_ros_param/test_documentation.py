"""docs/adapters/ros_param.md does what it says: its Python runs, its tables name what there is."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import attrs
import pytest
import yaml

pytest.importorskip("rclpy", reason="rclpy is not installed: the examples need it")

from beacon_core.lifecycle import Status
from beacon_core.parameters.fields import ENTITY_ID, PREFIX, read
from beacon_core.testing.harness import Listener
from beacon_ros_param.harness import RosParamHarness
from beacon_ros_param.options import RosParamOptions

if TYPE_CHECKING:
    from rclpy.node import Node

pytestmark = pytest.mark.system

PAGE = Path(__file__).parents[3] / "docs/adapters/ros_param.md"
WaitFor = Callable[..., None]


def blocks(language: str) -> list[str]:
    found = re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    return [str(block) for block in found]


@contextmanager
def running(code: str, domain_id: int | None) -> Iterator[subprocess.Popen[str]]:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id)}
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


def said(code: str, domain_id: int | None) -> str:
    with running(code, domain_id) as process:
        assert process.stdout is not None
        out = process.stdout.read().strip()
        assert process.wait(20.0) == 0
        return out


@pytest.fixture
def harness() -> Iterator[RosParamHarness]:
    made = RosParamHarness()
    yield made
    made.close()


@pytest.mark.parametrize(
    ("number", "entity_id", "ends_as"),
    [(0, "engine_temp", Status.LEFT), (1, "brake", Status.STALE)],
)
def test_its_nodes_come_and_leave(
    harness: RosParamHarness, wait_for: WaitFor, number: int, entity_id: str, ends_as: Status
) -> None:
    listener = Listener(harness).start()
    code = blocks("python")[number]
    with running(code, harness.options().domain_id) as process:
        wait_for(lambda: listener.has(entity_id), f"{entity_id} is heard")
        process.send_signal(signal.SIGINT)
        wait_for(lambda: listener.has(entity_id, ends_as), f"{entity_id} is {ends_as}")
        assert process.wait(20.0) == 0


def test_its_gateway_hears_the_nodes_of_its_apps(
    harness: RosParamHarness, wait_for: WaitFor
) -> None:
    domain_id = harness.options().domain_id
    engine, brake, gateway = blocks("python")
    listener = Listener(harness).start()
    with running(engine, domain_id), running(brake, domain_id):
        wait_for(lambda: listener.has("engine_temp") and listener.has("brake"), "both are there")
        # It looks for 5 s, which may be too short on a busy machine.
        assert any(said(gateway, domain_id) == "['brake', 'engine_temp']" for _ in range(3))


def test_its_parameter_file_is_a_hint(tmp_path: Path) -> None:
    from rclpy.context import Context  # noqa: PLC0415 - of this test alone
    from rclpy.node import Node  # noqa: PLC0415

    file = tmp_path / "parameters.yaml"
    file.write_text(blocks("yaml")[1], "utf-8")
    context = Context()
    context.init(args=["--ros-args", "--params-file", str(file)])
    node: Node = Node("any", context=context, automatically_declare_parameters_from_overrides=True)
    found = node.get_parameters([*node.list_parameters([PREFIX], 0).names])
    reading = read({one.name: one.value for one in found})
    node.destroy_node()
    context.try_shutdown()
    assert not reading.skipped
    assert reading.hint is not None
    written = yaml.safe_load(blocks("yaml")[1])["/**"]["ros__parameters"][PREFIX]
    assert reading.hint.entity_id == written["entity_id"]
    assert reading.hint.depends_on == tuple(written["depends_on"])
    assert dict(reading.hint.metadata) == written["metadata"]


def test_its_table_of_options_has_each_option_with_its_default() -> None:
    table = PAGE.read_text("utf-8").partition("## Options")[2].partition("## ")[0]
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]*) \|", table, re.MULTILINE))
    defaults = RosParamOptions()
    assert set(rows) == {field.name for field in attrs.fields(RosParamOptions)}
    for name in ("interval_s", "budget_s", "timeout_s", "max_in_flight", "forget_after_s"):
        assert float(rows[name]) == getattr(defaults, name)
    assert rows["parameter_events"] == str(defaults.parameter_events).lower()


def test_its_table_of_counters_has_each_counter(harness: RosParamHarness) -> None:
    source = harness.source()
    Listener(harness).start()
    source.start(Listener(harness).tap)
    table = PAGE.read_text("utf-8").partition("## Health")[2].partition("## ")[0]
    named = {
        name
        for row in re.findall(r"^\| (`[^|]*) \|", table, re.MULTILINE)
        for name in re.findall(r"`([a-z-]+)`", row)
    }
    assert named == set(source.health().counters)


def test_its_table_of_parameters_has_each_field() -> None:
    table = PAGE.read_text("utf-8").partition("## What a node declares")[2].partition("```")[0]
    for field in ("stable_id", "function_ids", "process_id", "metadata.<key>"):
        assert f"`.{field}`" in table
    assert f"`{ENTITY_ID}`" in table
