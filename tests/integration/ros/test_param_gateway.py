"""Nodes with parameters from a file, asked by a real ``beacon run``."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no parameters to ask for")

from beacon_ros.mortal import short_lease

if TYPE_CHECKING:
    from tests.integration.ros.conftest import Child, Children, Gateway

StartGateway = Callable[..., "Gateway"]
WaitUntil = Callable[..., None]

SENSOR = "apps/temp_sensor"
OURS = f"{SENSOR}/x-medkit-beacon"
CARRIERS = f"{SENSOR}/x-medkit-param-beacon"

PARAMETERS = Path(__file__).parent / "nodes" / "temp_sensor.yaml"

TTL_S = 5.0
INTERVAL_S = 1.0


def sources(options: str = "", ttl_s: float = TTL_S, interval_s: float = INTERVAL_S) -> str:
    every = f"interval_s: {interval_s}, {options}"
    return f"sources: {{params: {{adapter: ros_param, ttl_s: {ttl_s}, options: {{{every}}}}}}}"


def told(pid: int) -> dict[str, Any]:
    """What the node's parameters say, as the endpoint shows it."""
    return {
        "entity_id": "temp_sensor",
        "stable_id": "sn-0815",
        "display_name": "Temperature, engine (°C)",
        "function_ids": ["monitoring", "thermal"],
        "depends_on": ["can_bridge"],
        "component_id": "ecu_front",
        "transport_type": "shared_memory",
        "negotiated_format": "sensor_msgs/Temperature",
        "process_id": pid,
        "process_name": "temp_sensor_node",
        "hostname": socket.gethostname(),
        "metadata": {"firmware": "1.2.3", "vendor": "acme"},
    }


def set_parameter(children: Children, name: str, value: str) -> None:
    setting = children.node("param_set", "/temp_sensor", f"ros2_medkit.discovery.{name}", value)
    assert setting.ends() == 0, setting.err.read_text("utf-8")


def heard(gateway: Gateway) -> int:
    """How many answers came to be hints."""
    (source,) = gateway.get("health")[1]["x-medkit-beacon"]["sources"]
    return sum(map(int, source["messages"].values()))


def stays_active(gateway: Gateway, wait_until: WaitUntil) -> bool:
    """Is it active at every look, and in between, while it answers for longer than its ttl?"""
    before = gateway.becomes(OURS, "active")["history"]
    enough = heard(gateway) + (TTL_S + 2) / INTERVAL_S
    seen: set[str] = set()

    def is_over() -> bool:
        seen.add(gateway.status(CARRIERS))
        return seen != {"active"} or heard(gateway) > enough

    wait_until(is_over, "it has answered for longer than its ttl")
    return seen == {"active"} and gateway.get(OURS)[1]["history"] == before


@pytest.fixture
def sensor(children: Children) -> Callable[..., Child]:
    """Starts the node with the parameters of the file, and others on top."""

    def start(*parameters: str, env: Mapping[str, str] | None = None) -> Child:
        words = [word for parameter in parameters for word in ("-p", parameter)]
        file = ("--params-file", str(PARAMETERS))
        return children.node("declared_sensor", "--ros-args", *file, *words, env=env)

    return start


def test_a_node_with_a_parameters_file_is_active_with_all_14_fields_and_stays_so(
    gateway: StartGateway, sensor: Callable[..., Child], wait_until: WaitUntil
) -> None:
    running = gateway(sources())
    node = sensor()
    body = running.becomes(CARRIERS, "active")
    assert 0 <= body.pop("age_sec") < TTL_S
    assert body == {"status": "active", **told(node.pid)}
    assert len(body) == 13  # and the age
    # A machine that stands still for as long as the ttl makes it stale, rightly.
    assert any(stays_active(running, wait_until) for _ in range(3))
    _, body = running.get(OURS)
    steps = [step["status"] for step in body["history"]]
    assert (body["restarts"], steps) == (0, ["stale", "active"] * (len(steps) // 2))


def test_the_entity_lists_the_endpoint_and_an_unknown_entity_has_none(
    gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources())
    code, body = running.get(CARRIERS)
    assert (code, body["error_code"]) == (404, "entity-not-found")
    sensor()
    running.becomes(CARRIERS, "active")
    _, detail = running.get(SENSOR)
    listed = {one["name"]: one["href"] for one in detail["capabilities"]}
    assert listed["x-medkit-param-beacon"] == f"/api/v1/{CARRIERS}"
    assert detail["x-medkit"]["is_online"] is True
    code, body = running.get("apps/nobody/x-medkit-param-beacon")
    assert (code, body["error_code"]) == (404, "entity-not-found")


@pytest.mark.parametrize(
    ("parameter", "value", "field", "shown"),
    [
        ("display_name", "Coolant", "display_name", "Coolant"),
        ("function_ids", "[cooling]", "function_ids", ["cooling"]),
        ("metadata.firmware", "'2.0'", "metadata", {"firmware": "2.0", "vendor": "acme"}),
    ],
)
def test_a_parameter_that_is_set_by_service_is_seen_at_the_next_poll(
    parameter: str,
    value: str,
    field: str,
    shown: object,
    gateway: StartGateway,
    sensor: Callable[..., Child],
    children: Children,
    wait_until: WaitUntil,
) -> None:
    running = gateway(sources("parameter_events: false"))
    sensor()
    running.becomes(CARRIERS, "active")
    set_parameter(children, parameter, value)
    wait_until(lambda: running.get(CARRIERS)[1].get(field) == shown, f"{field} is {shown}")


def test_a_parameter_that_is_set_is_seen_long_before_the_next_poll(
    gateway: StartGateway, sensor: Callable[..., Child], children: Children, wait_until: WaitUntil
) -> None:
    running = gateway(sources(ttl_s=3600.0, interval_s=600.0))
    sensor()
    running.becomes(CARRIERS, "active")
    set_parameter(children, "display_name", "Coolant")
    wait_until(lambda: running.get(CARRIERS)[1].get("display_name") == "Coolant")


def test_parameters_of_a_wrong_type_or_an_unknown_name_are_left_out_and_the_others_count(
    gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources())
    node = sensor(
        "ros2_medkit.discovery.display_name:=7",
        "ros2_medkit.discovery.depends_on:=[1, 2]",
        "ros2_medkit.discovery.metadata.vendor:=true",
        "ros2_medkit.discovery.colour:=blue",
    )
    body = running.becomes(CARRIERS, "active")
    assert {key: body[key] for key in told(0)} == {
        **told(node.pid),
        "display_name": "",
        "depends_on": [],
        "metadata": {"firmware": "1.2.3"},
    }


def test_a_node_that_hangs_is_stale_for_its_silence_and_active_once_it_goes_on(
    gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources())
    node = sensor()
    running.becomes(OURS, "active")
    node.signal(signal.SIGSTOP)
    assert running.becomes(OURS, "stale")["cause"] == "silent"
    assert running.status(CARRIERS) == "stale"
    node.signal(signal.SIGCONT)
    body = running.becomes(OURS, "active")
    assert (body["restarts"], body["process_id"]) == (0, node.pid)
    assert [step["status"] for step in body["history"]] == ["stale", "active"]


def test_a_killed_node_is_stale_and_a_restarted_one_active_again(
    gateway: StartGateway, sensor: Callable[..., Child], wait_until: WaitUntil
) -> None:
    running = gateway(sources())
    first = sensor()
    running.becomes(OURS, "active")
    first.signal(signal.SIGKILL)
    # ROS misses it after 20 s; the gateway does not wait for that.
    assert running.becomes(OURS, "stale", within_s=18.0)["cause"] == "silent"
    second = sensor()
    body = running.becomes(OURS, "active")
    assert (body["process_id"], body["conflict"]) == (second.pid, False)
    # Until ROS misses the first, there are two nodes of one name, of which one answers.
    wait_until(lambda: running.get(OURS)[1]["restarts"] == 1, "a restart is counted")
    assert running.becomes(OURS, "active")["process_id"] == second.pid


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_node_that_leaves_the_ros_graph_is_stale_however_long_its_ttl(
    number: signal.Signals, gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources(ttl_s=300.0))
    node = sensor(env=short_lease())
    running.becomes(OURS, "active")
    node.signal(number)
    body = running.becomes(OURS, "stale")
    assert (body["cause"], body["reason"]) == ("lost", "its node left the ROS graph")


def test_a_node_restarted_in_a_moment_is_one_that_was_restarted(
    gateway: StartGateway, sensor: Callable[..., Child], wait_until: WaitUntil
) -> None:
    running = gateway(sources(ttl_s=300.0))
    first = sensor()
    running.becomes(OURS, "active")
    first.signal(signal.SIGINT)
    first.ends()
    second = sensor()
    wait_until(lambda: running.get(OURS)[1]["process_id"] == second.pid, "the second answers")
    assert running.becomes(OURS, "active")["restarts"] == 1


def test_of_apps_that_name_their_nodes_only_those_are_asked(
    gateway: StartGateway, sensor: Callable[..., Child], children: Children, wait_until: WaitUntil
) -> None:
    asks_all = gateway(sources())
    asks_one = gateway(
        f"{sources()}\nentities: {{apps: [{{id: temp_sensor, ros_node: /temp_sensor}}]}}"
    )
    sensor()
    children.node(
        "declared_sensor",
        *("--ros-args", "-r", "__node:=other", "-p", "ros2_medkit.discovery.entity_id:=other"),
    )
    asks_all.becomes("apps/other/x-medkit-param-beacon", "active")
    asks_one.becomes(CARRIERS, "active")
    before = heard(asks_one)
    wait_until(lambda: heard(asks_one) > before + 2, "it has asked again")
    assert [one["id"] for one in asks_one.get("apps")[1]["items"]] == ["temp_sensor"]


def test_what_a_node_declares_may_be_set_from_outside(
    gateway: StartGateway, children: Children, wait_until: WaitUntil
) -> None:
    running = gateway(sources())
    node = children.node("declaring_sensor")
    body = running.becomes(CARRIERS, "active")
    assert (body["display_name"], body["process_id"]) == ("Temperature", node.pid)
    set_parameter(children, "metadata.firmware", "'2.0'")
    wait_until(lambda: running.get(CARRIERS)[1]["metadata"] == {"firmware": "2.0"})


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_closes_its_beacon_when_told_to_stop_has_left(
    number: signal.Signals, gateway: StartGateway, children: Children
) -> None:
    running = gateway(sources(ttl_s=300.0))
    node = children.node("declaring_sensor")
    running.becomes(OURS, "active")
    node.signal(number)
    assert node.ends() == 0
    running.becomes(OURS, "left", within_s=15.0)


def test_an_announced_entity_is_active_and_has_left_after_ctrl_c(
    gateway: StartGateway, children: Children
) -> None:
    running = gateway(sources())
    announcer = children.beacon(
        *("announce", "--adapter", "ros_param", "--entity-id", "temp_sensor"),
        *("--display-name", "Temperature"),
    )
    body = running.becomes(CARRIERS, "active")
    assert (body["display_name"], body["process_id"]) == ("Temperature", announcer.pid)
    announcer.signal(signal.SIGINT)
    assert announcer.ends() == 0
    assert "said goodbye" in announcer.err.read_text("utf-8")
    running.becomes(OURS, "left", within_s=15.0)
    assert running.get(CARRIERS)[0] == 404


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_gateway_told_to_stop_ends_with_0_and_says_no_more_than_that(
    number: signal.Signals, gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources())
    sensor()
    running.becomes(CARRIERS, "active")
    running.child.signal(number)
    assert running.child.ends() == 0
    said = running.child.err.read_text("utf-8").splitlines()
    assert len(said) == 2, said
    assert said[0].endswith(f"serving {running.url}")
    assert said[1].endswith("stopped")
