"""docs/adapters/ros_topic.md does what it says: its Python runs, its tables name what there is."""

from __future__ import annotations

import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import attrs
import pytest
import yaml

pytest.importorskip("rclpy", reason="rclpy is not installed: the examples need it")

from beacon_core.lifecycle import Status
from beacon_core.testing.harness import Listener
from beacon_ros.environment import MAX_DOMAIN
from beacon_ros_topic import ADAPTER, RosTopicOptions
from beacon_ros_topic.beacon import BEACON_QOS
from beacon_ros_topic.harness import RosTopicHarness
from beacon_ros_topic.looks import _BUSY_SHARE, _EVERY_S, _IDLE_SHARE
from beacon_ros_topic.roster import MAX_PUBLISHERS, MAX_SPOKEN_FOR

pytestmark = pytest.mark.system

PAGE = Path(__file__).parents[3] / "docs/adapters/ros_topic.md"

Eventually = Callable[..., None]
Start = Callable[[str], subprocess.Popen[str]]
End = Callable[[subprocess.Popen[str]], tuple[int, str, str]]


def blocks(language: str) -> list[str]:
    found = re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    return [str(block) for block in found]


def section(title: str) -> str:
    return PAGE.read_text("utf-8").partition(f"## {title}\n")[2].partition("\n## ")[0]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_its_node_is_heard_and_leaves_when_it_is_told_to_stop(
    harness: RosTopicHarness,
    start_script: Start,
    end: End,
    eventually: Eventually,
    number: signal.Signals,
) -> None:
    listener = Listener(harness).start()
    node = start_script(blocks("python")[0])
    eventually(lambda: listener.has("engine_temp"))

    def updated() -> bool:
        stored = listener.store.get("engine_temp")
        return stored is not None and dict(stored.hint.metadata) == {"mode": "calibrating"}

    eventually(updated)
    node.send_signal(number)
    eventually(lambda: listener.has("engine_temp", Status.LEFT))
    end(node)


def test_its_announcer_speaks_for_many_until_it_is_closed(
    harness: RosTopicHarness, start_script: Start, end: End, eventually: Eventually
) -> None:
    listener = Listener(harness).start()
    program = start_script(blocks("python")[1])
    eventually(lambda: listener.has("engine"))
    eventually(lambda: not listener.has("brake"))
    assert program.stdin is not None
    program.stdin.write("\n")
    assert end(program) == (0, "", "")
    eventually(lambda: listener.has("engine", Status.LEFT))


def test_its_gateway_hears_its_node(
    harness: RosTopicHarness, start_script: Start, eventually: Eventually
) -> None:
    listener = Listener(harness).start()
    node, _, gateway = blocks("python")
    start_script(node)
    eventually(lambda: listener.has("engine_temp"))
    out, err = start_script(gateway).communicate(timeout=60)
    assert (out, err) == ("['engine_temp']\n", "")


def test_its_configuration_is_one() -> None:
    (source,) = yaml.safe_load(blocks("yaml")[0])["sources"].values()
    assert source == {"adapter": ADAPTER.name}


def test_its_table_of_options_has_each_option_with_its_default() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]*) \|", section("Options"), re.MULTILINE))
    defaults = RosTopicOptions()
    assert {name for name in rows if hasattr(defaults, name)} == {
        field.name for field in attrs.fields(RosTopicOptions)
    }
    for name in ("topic", "reliability", "durability", "depth"):
        assert rows[name].strip("`") == str(getattr(defaults, name))
    assert f"0 to {MAX_DOMAIN}" in section("Options")


def test_its_table_of_counters_has_each_counter(harness: RosTopicHarness) -> None:
    named = {
        name
        for row in re.findall(r"^\| (`[^|]*) \|", section("Health"), re.MULTILINE)
        for name in re.findall(r"`([a-z-]+)`", row)
    }
    assert named == set(harness.source().health().counters)


def test_its_numbers_are_ours() -> None:
    assert f"({MAX_PUBLISHERS:,})" in section("Health")
    assert f"({MAX_SPOKEN_FOR:,})" in section("Health")
    assert (_EVERY_S, _BUSY_SHARE, _IDLE_SHARE) == (2.0, 1 / 10, 1 / 200)
    offered = (BEACON_QOS.reliability.name, BEACON_QOS.durability.name)
    assert offered == ("RELIABLE", "TRANSIENT_LOCAL")
