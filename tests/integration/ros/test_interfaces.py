"""The message's package, and the type made at run time, are one and the same to ROS."""

from __future__ import annotations

import re
import socket
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no ROS messages to compare")

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.graph import Endpoint, publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import raw_type
from beacon_ros_topic.options import DEFAULT_TOPIC

if TYPE_CHECKING:
    from tests.integration.ros.conftest import Child, Children

README = Path(__file__).parents[3] / "adapters" / "ros_topic" / "interfaces" / "README.md"

WaitUntil = Callable[..., None]

HINT = BeaconHint(
    entity_id="pump-7",
    stable_id="sn-1",
    display_name="Kühlmittelpumpe 日本",
    function_ids=("cooling", "monitoring", "x"),
    depends_on=("ecu_front",),
    component_id="ecu_rear",
    transport_type="shared_memory",
    negotiated_format="sensor_msgs/Temperature",
    process_id=2**32 - 1,
    process_name="pump",
    hostname="robot-1",
    metadata={"firmware": "1.2", "empty": "", "k": "ü" * 500},
)
STAMP_NS = 1_700_000_000_123_456_789


@pytest.fixture
def node(domain: int) -> Iterator[Node]:
    with closing(OwnNode("test", domain)) as own:
        yield own.node


def endpoint(node: Node, wait_until: WaitUntil) -> Endpoint:
    """The topic's only publisher, once its node is known."""

    def known() -> bool:
        listed = publishers(node, DEFAULT_TOPIC)
        return len(listed) == 1 and bool(listed[0].node)

    wait_until(known, "the graph knows the publisher")
    return publishers(node, DEFAULT_TOPIC)[0]


def subscribe(node: Node) -> list[bytes]:
    """What is heard once the node is spun, as it was on the wire."""
    heard: list[bytes] = []
    raw = raw_type(TYPE_NAME, TYPE_HASH)
    node.create_subscription(raw, DEFAULT_TOPIC, heard.append, 10, raw=True)
    return heard


def hear(node: Node, heard: list[bytes], wait_until: WaitUntil, count: int) -> list[bytes]:
    """Spin the node until so many messages have been heard."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def spun() -> bool:
        executor.spin_once(0.1)
        return len(heard) >= count

    wait_until(spun, f"{count} messages")
    executor.shutdown()
    return heard


def sensor(children: Children, typed: Mapping[str, str]) -> Child:
    return children.node("temp_sensor", env=typed)


def test_a_typed_publisher_announces_the_name_and_the_hash_that_are_built_in_here(
    node: Node, children: Children, typed: Mapping[str, str], wait_until: WaitUntil
) -> None:
    sensor(children, typed)
    announced = endpoint(node, wait_until)
    assert announced.node == "/temp_sensor"
    assert (announced.type_name, announced.type_hash) == (TYPE_NAME, TYPE_HASH)


def test_the_type_made_at_run_time_announces_the_same(node: Node, wait_until: WaitUntil) -> None:
    node.create_publisher(raw_type(TYPE_NAME, TYPE_HASH), DEFAULT_TOPIC, 10)
    announced = endpoint(node, wait_until)
    assert (announced.type_name, announced.type_hash) == (TYPE_NAME, TYPE_HASH)


@pytest.mark.parametrize("first", ["publisher", "subscriber"])
def test_what_a_typed_node_sends_is_read_in_full_from_its_raw_bytes(
    first: str, node: Node, children: Children, typed: Mapping[str, str], wait_until: WaitUntil
) -> None:
    child = sensor(children, typed) if first == "publisher" else None
    if child:
        endpoint(node, wait_until)
    heard = subscribe(node)
    child = child or sensor(children, typed)
    for payload in hear(node, heard, wait_until, 2):
        read = cdr.decode(payload)
        assert isinstance(read, Announcement)
        assert read.hint == BeaconHint(
            entity_id="temp_sensor",
            stable_id="sn-0815",
            display_name="Temperature, engine (°C)",
            function_ids=("monitoring", "thermal"),
            depends_on=("can_bridge",),
            component_id="ecu_front",
            transport_type="shared_memory",
            negotiated_format="sensor_msgs/Temperature",
            process_id=child.pid,
            process_name="temp_sensor_node",
            hostname=socket.gethostname(),
            metadata={"firmware": "1.2.3", "vendor": "acme"},
        )
        assert read.repairs == ()
        assert 0 <= time.time_ns() - read.stamp_ns < 60e9


def test_the_readmes_program_publishes_its_hint(
    node: Node,
    children: Children,
    typed: Mapping[str, str],
    wait_until: WaitUntil,
    tmp_path: Path,
) -> None:
    (program,) = re.findall(
        r"^```python\n(.*?)^```", README.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    script = tmp_path / "engine_temp.py"
    script.write_text(program, "utf-8")
    children.start(sys.executable, script, env=typed)
    (payload,) = hear(node, subscribe(node), wait_until, 1)
    read = cdr.decode(payload)
    assert isinstance(read, Announcement)
    assert read.hint == BeaconHint("engine_temp", depends_on=("engine_ecu",))


@pytest.mark.parametrize("first", ["publisher", "subscriber"])
@pytest.mark.parametrize("behind", [b"", b"\nbeacon-goodbye\n", b"\xff"], ids=["", "mark", "odd"])
def test_raw_bytes_arrive_whole_at_a_typed_node_whatever_is_behind_the_message(
    first: str,
    behind: bytes,
    node: Node,
    children: Children,
    typed: Mapping[str, str],
    wait_until: WaitUntil,
) -> None:
    def listener() -> Child:
        child = children.node("hint_listener", env=typed)
        wait_until(child.said, "the other process has subscribed")
        return child

    child = listener() if first == "subscriber" else None
    publisher = node.create_publisher(raw_type(TYPE_NAME, TYPE_HASH), DEFAULT_TOPIC, 10)
    child = child or listener()

    def arrived() -> bool:
        # Again and again: the two ends of a new connection do not open at the same moment.
        publisher.publish(cdr.encode(HINT, STAMP_NS) + behind)
        return len(child.said()) > 1

    wait_until(arrived, "a hint has arrived")
    expected: dict[str, Any] = {
        **attrs.asdict(HINT),
        "function_ids": list(HINT.function_ids),
        "depends_on": list(HINT.depends_on),
        "metadata": dict(HINT.metadata),
        "stamp": [1_700_000_000, 123_456_789],
    }
    assert child.said()[1] == expected
