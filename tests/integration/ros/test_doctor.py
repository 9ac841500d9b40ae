"""Empty views on a real ROS network, and what is said of each."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no network to look at")

from rclpy.context import Context
from rclpy.node import Node

from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.examination import Finding, Level
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros import examine as module
from beacon_ros.domains import DomainLease
from beacon_ros.rawtype import raw_type
from beacon_ros.spinner import Spinner
from beacon_ros_param import ADAPTER as PARAM
from beacon_ros_topic import ADAPTER as TOPIC
from beacon_ros_topic import RosTopicOptions
from beacon_ros_topic.qos import profile

if TYPE_CHECKING:
    from tests.integration.ros.conftest import Children

HINTS = "/ros2_medkit/discovery"
ENOUGH_S = 20.0
"""For what is there: the look ends when it is seen."""
NO_TIME_S = 4.0
"""For what is not there. Discovery sometimes takes 3 s."""
ELSEWHERE_S = 6.0
"""For what is there, but on another domain: so long nobody is seen here."""

OTHER_HASH = "RIHS01_" + "ab" * 32


@attrs.define
class Robots:
    """Nodes of this process, each in a context of its own unless told otherwise."""

    domain: int
    stack: ExitStack

    def context(self, domain: int | None = None) -> Context:
        """Stands for a process."""
        context = Context()
        domain_id = self.domain if domain is None else domain
        context.init(args=[], domain_id=domain_id, initialize_logging=False)
        self.stack.callback(context.try_shutdown)
        return context

    def node(
        self,
        name: str,
        *,
        context: Context | None = None,
        domain: int | None = None,
        hung: bool = False,
        **more: Any,
    ) -> Node:
        """A node; hung: its services are there, and nobody serves them."""
        context = context or self.context(domain)
        node = Node(name, context=context, use_global_arguments=False, enable_rosout=False, **more)
        self.stack.callback(node.destroy_node)
        if not hung:
            spinner = Spinner(context, node)
            self.stack.callback(spinner.close, 5.0)
        return node

    def publisher(
        self,
        name: str,
        topic: str = HINTS,
        *,
        type_name: str = TYPE_NAME,
        type_hash: str = TYPE_HASH,
        qos: Any = 10,
        domain: int | None = None,
    ) -> None:
        """A node that publishes hints."""
        node = self.node(name, domain=domain, start_parameter_services=False)
        node.create_publisher(raw_type(type_name, type_hash), topic, qos)

    def declaring(self, name: str, parameters: Mapping[str, Any], **more: Any) -> None:
        """A node with these parameters."""
        node = self.node(name, **more)
        for key, value in parameters.items():
            node.declare_parameter(key, value)


@pytest.fixture
def robots(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Robots]:
    # On other domains there may be other tests.
    monkeypatch.setattr(module, "OTHER_DOMAINS", ())
    with ExitStack() as stack:
        yield Robots(domain, stack)


def look(adapter: Adapter, seconds: float = ENOUGH_S, **options: Any) -> list[Finding]:
    assert adapter.examine is not None
    found = list(adapter.examine(adapter.options(**options), seconds))
    # Whoever finds anything begins by saying where it looked.
    assert found[0].what.startswith("ROS 2 ")
    assert found[1].what.startswith("domain ")
    return found


def of_interest(found: list[Finding]) -> list[tuple[Level, str]]:
    """What is not about the machine on which the tests run."""
    machine = ("ROS", "FASTRTPS_", "domain ", "this is a container", "the message type")
    return [(one.level, one.what) for one in found if not one.what.startswith(machine)]


def problems(found: list[Finding]) -> list[Finding]:
    return [one for one in found if one.level is Level.PROBLEM]


# Both


@pytest.mark.parametrize("adapter", [TOPIC, PARAM], ids=lambda adapter: adapter.name)
def test_an_empty_domain(robots: Robots, adapter: Adapter) -> None:
    found = look(adapter, NO_TIME_S)
    assert of_interest(found) == [(Level.PROBLEM, f"no node is seen on domain {robots.domain}")]
    assert found[1].what == f"domain {robots.domain} (ROS_DOMAIN_ID={robots.domain})"


@pytest.mark.parametrize("adapter", [TOPIC, PARAM], ids=lambda adapter: adapter.name)
def test_a_robot_on_another_domain(
    robots: Robots, adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    with DomainLease() as other:
        monkeypatch.setattr(module, "OTHER_DOMAINS", (other.domain_id,))
        monkeypatch.setattr(module, "_OTHERS_S", ELSEWHERE_S)
        robots.publisher("arm", domain=other.domain_id)
        found = look(adapter, ELSEWHERE_S)
    assert of_interest(found)[0][1] == f"no node is seen on domain {robots.domain}"
    (hint,) = [one for one in found if "/arm" in one.what]
    assert hint.what == f"domain {other.domain_id} has 1 node: /arm"
    assert f"domain_id: {other.domain_id}" in hint.advice


# The topic


def test_a_topic_on_which_all_is_well(robots: Robots) -> None:
    robots.publisher("arm")
    robots.publisher("lidar")
    found = look(TOPIC)
    assert of_interest(found) == [(Level.OK, f"published on {HINTS} by /arm, /lidar")]
    assert "the message type is made at run time: ros2_medkit_msgs is not needed" in [
        one.what for one in found
    ]


def offering(**qos: Any) -> Any:
    return profile(RosTopicOptions(depth=1, **qos))


def test_publishers_that_offer_less_than_is_asked_for(robots: Robots) -> None:
    robots.publisher("well", qos=offering(durability="transient_local"))
    robots.publisher("lossy", qos=offering(reliability="best_effort", durability="transient_local"))
    robots.publisher("forgetful", qos=offering())
    found = look(TOPIC, durability="transient_local")
    assert (Level.OK, f"published on {HINTS} by /well") in of_interest(found)
    by_name = {one.what.split()[0]: one for one in problems(found)}
    assert set(by_name) == {"/lossy", "/forgetful"}
    lossy, forgetful = by_name["/lossy"], by_name["/forgetful"]
    assert "offers reliability best_effort, this source wants reliable" in lossy.what
    assert "set reliability: best_effort here" in lossy.advice
    assert "offers durability volatile, this source wants transient_local" in forgetful.what
    # What is advised helps.
    relaxed = look(TOPIC, reliability="best_effort")
    assert problems(relaxed) == []


def test_a_publisher_with_another_definition_of_the_message(robots: Robots) -> None:
    robots.publisher("old", type_hash=OTHER_HASH)
    (found,) = problems(look(TOPIC))
    assert found.what == (
        "/old has another definition of the message: RIHS01_abababab, here it is RIHS01_16ec18a7"
    )


def test_a_publisher_of_something_else(robots: Robots) -> None:
    robots.publisher("chatter", type_name="std_msgs/msg/String", type_hash=OTHER_HASH)
    (found,) = problems(look(TOPIC))
    assert found.what == (
        f"/chatter is not heard: it publishes std_msgs/msg/String, not {TYPE_NAME}"
    )


def test_many_publishers_with_a_fault_are_summed_up(robots: Robots) -> None:
    node = robots.node("many", start_parameter_services=False)
    for _ in range(8):
        node.create_publisher(raw_type(TYPE_NAME, OTHER_HASH), HINTS, 10)
    found = problems(look(TOPIC))
    assert len(found) == 6
    assert found[-1].what == "of 3 more publishers something of the kind is true"


def test_hints_on_another_topic(robots: Robots) -> None:
    robots.publisher("arm", "/robot_1/ros2_medkit/discovery")
    listener = robots.node("listener", start_parameter_services=False)
    listener.create_subscription(
        raw_type(TYPE_NAME, TYPE_HASH), "/nobody/publishes", print, 10, raw=True
    )
    found = look(TOPIC, NO_TIME_S)
    assert of_interest(found) == [
        (Level.OK, f"2 nodes on domain {robots.domain}: /arm, /listener"),
        (Level.PROBLEM, f"nobody publishes {HINTS}"),
        (
            Level.NOTE,
            "hints are published on another topic, /robot_1/ros2_medkit/discovery, by /arm",
        ),
    ]
    assert found[-1].advice == "to hear them: topic: /robot_1/ros2_medkit/discovery"
    assert problems(look(TOPIC, topic="/robot_1/ros2_medkit/discovery")) == []


def test_publishers_on_another_domain_while_somebody_else_is_here(
    robots: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    robots.node("joystick")
    with DomainLease() as other:
        monkeypatch.setattr(module, "OTHER_DOMAINS", (other.domain_id,))
        monkeypatch.setattr(module, "_OTHERS_S", ELSEWHERE_S)
        robots.publisher("arm", domain=other.domain_id)
        found = look(TOPIC, ELSEWHERE_S)
    assert of_interest(found)[1:2] == [(Level.PROBLEM, f"nobody publishes {HINTS}")]
    assert found[-1].what == (
        f"domain {other.domain_id} has 1 node with a publisher of {HINTS}: /arm"
    )


# The parameters

ARM = {ENTITY_ID: "arm"}


def test_nodes_on_which_all_is_well(robots: Robots) -> None:
    robots.declaring("driver", {**ARM, f"{PREFIX}.metadata.firmware": "1.2"}, namespace="/arm")
    robots.declaring("lidar", {ENTITY_ID: "lidar"})
    assert of_interest(look(PARAM)) == [
        (Level.OK, f"2 nodes on domain {robots.domain}: /arm/driver, /lidar"),
        (Level.OK, f"{PREFIX}.* is declared by /arm/driver (arm), /lidar (lidar)"),
    ]


def test_a_hung_node_is_named_and_the_others_are_seen_all_the_same(robots: Robots) -> None:
    robots.declaring("hung", {ENTITY_ID: "hung"}, hung=True)
    robots.declaring("arm", ARM)
    found = look(PARAM, timeout_s=1.0)
    assert (Level.OK, f"{PREFIX}.* is declared by /arm (arm)") in of_interest(found)
    (hung,) = problems(found)
    assert hung.what == "no answer to list_parameters or get_parameters in 1 s: /hung"


def test_a_node_without_parameter_services_is_named(robots: Robots) -> None:
    robots.node("mute", start_parameter_services=False)
    found = look(PARAM)
    assert found[-1].what == "without parameter services, and so not asked: /mute"
    assert found[-1].level is Level.NOTE


def test_nodes_of_which_none_declares_anything(robots: Robots) -> None:
    robots.declaring("plain", {"speed": 1.0})
    (found,) = problems(look(PARAM))
    assert found.what == f"no node declares {PREFIX}.*"
    assert ENTITY_ID in found.advice


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        ({f"{PREFIX}.display_name": "Arm"}, "not entity_id among them"),
        ({ENTITY_ID: 7}, "entity_id is no text but of type int"),
        ({ENTITY_ID: ""}, "entity_id is empty"),
        ({ENTITY_ID: "a b"}, "entity_id is no id: 1 to 256 of A-Z a-z 0-9 _ -"),
    ],
)
def test_a_node_whose_entity_id_cannot_be_used(
    robots: Robots, parameters: dict[str, Any], why: str
) -> None:
    robots.declaring("arm", parameters)
    (found,) = problems(look(PARAM))
    assert found.what == f"/arm declares {PREFIX}.*, but {why}"


def test_many_nodes_with_a_fault_are_summed_up(robots: Robots) -> None:
    together = robots.context()
    for number in range(7):
        robots.declaring(f"n{number}", {ENTITY_ID: number}, context=together)
    found = problems(look(PARAM))
    assert len(found) == 6
    assert found[-1].what == "so it is with 2 more nodes"


def test_what_cannot_be_used_besides_is_told(robots: Robots) -> None:
    wrong = {f"{PREFIX}.process_id": "many", f"{PREFIX}.no_such_field": "x"}
    robots.declaring("arm", ARM | wrong)
    found = look(PARAM)
    assert problems(found) == []
    assert found[-1].level is Level.NOTE
    assert found[-1].what.startswith(f"of /arm is left out: '{PREFIX}.")
    assert found[-1].what.endswith("(and 1 more)")


def test_targets_that_are_not_there_are_named_and_only_targets_are_asked(robots: Robots) -> None:
    robots.declaring("arm", ARM)
    robots.declaring("lidar", {ENTITY_ID: "lidar"})
    found = look(PARAM, targets=("/arm", "/gone"))
    assert of_interest(found) == [
        (Level.OK, f"1 node on domain {robots.domain}: /arm"),
        (Level.PROBLEM, "among the targets, but not there: /gone"),
        (Level.OK, f"{PREFIX}.* is declared by /arm (arm)"),
    ]


# The command


CONFIG = "http: {port: 9}\nsources: {topic: {adapter: ros_topic}, params: {adapter: ros_param}}\n"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "doctor.yaml"
    path.write_text(CONFIG)
    return path


def test_the_command_tells_it_all_and_ends_cleanly(
    robots: Robots, children: Children, config: Path
) -> None:
    robots.publisher("arm")
    robots.declaring("lidar", {ENTITY_ID: "lidar"})
    child = children.beacon("doctor", "-c", config, "--json", "--seconds", "20")
    assert child.ends() == 0
    document = json.loads(child.out.read_text())
    assert document["ok"] is True
    topic, params = document["sources"]
    assert (topic["name"], topic["adapter"]) == ("topic", "ros_topic")
    assert topic["findings"][-1]["what"] == f"published on {HINTS} by /arm"
    assert params["findings"][-1]["what"] == f"{PREFIX}.* is declared by /lidar (lidar)"
    assert child.err.read_text() == ""


def test_an_interrupted_command_ends_at_once_with_its_exit_code(
    robots: Robots, children: Children, config: Path, wait_until: Callable[..., None]
) -> None:
    child = children.beacon("doctor", "-c", config, "--seconds", "20")
    joined = robots.node("observer")
    wait_until(
        lambda: any(name.startswith("_beacon_doctor") for name in joined.get_node_names()),
        "the doctor looks",
    )
    child.signal(signal.SIGINT)
    assert child.ends(15.0) == 130  # it would have looked for 20 s
    assert child.err.read_text() == ""
