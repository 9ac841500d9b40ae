"""Nodes as anybody writes them, heard by a real ``beacon run`` over a ROS topic."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no ROS to be heard over")

from beacon_ros.mortal import short_lease

if TYPE_CHECKING:
    from tests.integration.ros.conftest import Child, Children, Gateway

StartGateway = Callable[..., "Gateway"]
WaitUntil = Callable[..., None]

SENSOR = "apps/temp_sensor"
OURS = f"{SENSOR}/x-medkit-beacon"
CARRIERS = f"{SENSOR}/x-medkit-topic-beacon"

TTL_S = 3.0
"""The node speaks every 0.5 s."""


def sources(options: str = "", ttl_s: float = TTL_S) -> str:
    return f"sources: {{topic: {{adapter: ros_topic, ttl_s: {ttl_s}, options: {{{options}}}}}}}"


def told(pid: int) -> dict[str, Any]:
    """What the node says, as the endpoint shows it."""
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


def health(gateway: Gateway) -> dict[str, Any]:
    (source,) = gateway.get("health")[1]["x-medkit-beacon"]["sources"]
    return dict(source)


def stays_active(gateway: Gateway, wait_until: WaitUntil) -> bool:
    """Is it active at every look while the node speaks for longer than its ttl?"""
    gateway.becomes(CARRIERS, "active")
    enough = messages(gateway) + 2 * (TTL_S + 1)
    seen: set[str] = set()

    def is_over() -> bool:
        seen.add(gateway.status(CARRIERS))
        return seen != {"active"} or messages(gateway) > enough

    wait_until(is_over, "it has spoken for longer than its ttl")
    return seen == {"active"}


def messages(gateway: Gateway) -> int:
    return int(health(gateway)["counters"]["messages"])


@pytest.fixture
def sensor(children: Children, typed: Mapping[str, str]) -> Callable[..., Child]:
    """Starts the node, with ROS parameters and more of an environment."""

    def start(*parameters: str, env: Mapping[str, str] | None = None) -> Child:
        words = [word for parameter in parameters for word in ("-p", parameter)]
        return children.node("temp_sensor", "--ros-args", *words, env={**typed, **(env or {})})

    return start


@pytest.mark.parametrize(
    ("options", "parameters"),
    [
        pytest.param("", ("reliability:=reliable",), id="reliable"),
        pytest.param(
            "reliability: best_effort", ("reliability:=best_effort",), id="both-best-effort"
        ),
        pytest.param("reliability: best_effort", (), id="best-effort-hears-reliable"),
        pytest.param("", ("use_sim_time:=true",), id="simulated-time"),
    ],
)
def test_a_typed_node_is_active_with_all_14_fields_and_stays_so_for_longer_than_its_ttl(
    options: str,
    parameters: tuple[str, ...],
    gateway: StartGateway,
    sensor: Callable[..., Child],
    children: Children,
    wait_until: WaitUntil,
) -> None:
    if "use_sim_time:=true" in parameters:
        children.node("sim_clock")
    running = gateway(sources(options))
    node = sensor(*parameters)
    body = running.becomes(CARRIERS, "active")
    assert 0 <= body.pop("age_sec") < TTL_S
    assert body == {"status": "active", **told(node.pid)}
    assert len(body) == 13  # and the age
    # A machine that stands still for as long as the ttl makes it stale, rightly.
    assert any(stays_active(running, wait_until) for _ in range(3))
    assert health(running)["hints"]["restarts"] == 0


def test_a_gateway_that_has_the_messages_package_hears_the_same(
    gateway: StartGateway, sensor: Callable[..., Child], typed: Mapping[str, str]
) -> None:
    running = gateway(sources(), env=typed)
    node = sensor()
    body = running.becomes(CARRIERS, "active")
    assert {key: body[key] for key in told(0)} == told(node.pid)


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
    assert listed["x-medkit-topic-beacon"] == f"/api/v1/{CARRIERS}"
    assert detail["x-medkit"]["is_online"] is True
    assert detail["is-located-on"] == "/api/v1/components/ecu_front"
    code, body = running.get("apps/nobody/x-medkit-topic-beacon")
    assert (code, body["error_code"]) == (404, "entity-not-found")


def test_a_known_entity_that_has_not_spoken_has_no_beacon(gateway: StartGateway) -> None:
    running = gateway(f"{sources()}\nentities: {{apps: [{{id: temp_sensor}}]}}")
    code, body = running.get(CARRIERS)
    assert (code, body["vendor_code"]) == (404, "x-medkit-beacon-not-found")


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
    gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources())
    first = sensor()
    running.becomes(OURS, "active")
    first.signal(signal.SIGKILL)
    # ROS misses it after 20 s; the gateway does not wait for that.
    assert running.becomes(OURS, "stale", within_s=15.0)["cause"] == "silent"
    second = sensor()
    body = running.becomes(OURS, "active")
    assert (body["restarts"], body["process_id"]) == (1, second.pid)
    assert body["conflict"] is False


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_node_that_leaves_the_ros_graph_is_stale_however_long_its_ttl(
    number: signal.Signals, gateway: StartGateway, sensor: Callable[..., Child]
) -> None:
    running = gateway(sources(ttl_s=300.0))
    node = sensor(env=short_lease())
    running.becomes(OURS, "active")
    node.signal(number)
    body = running.becomes(OURS, "stale")
    assert body["cause"] == "lost"
    assert "left the ROS graph" in body["reason"]


def test_a_best_effort_publisher_that_a_reliable_source_cannot_hear_is_named_in_health(
    gateway: StartGateway, sensor: Callable[..., Child], wait_until: WaitUntil
) -> None:
    running = gateway(sources())
    sensor("reliability:=best_effort")
    wait_until(lambda: "/temp_sensor" in health(running).get("detail", ""), "health names it")
    found = health(running)
    assert found["condition"] == "degraded"
    assert found["detail"] == (
        "/temp_sensor is not heard: it offers reliability best_effort, this source wants "
        "reliable; set reliability: best_effort here, or reliable there"
    )
    assert found["counters"]["incompatible"] == 1
    assert running.status(CARRIERS) == "entity-not-found"
    wait_until(lambda: "/temp_sensor is not heard" in running.child.err.read_text("utf-8"))


def test_a_nodes_beacon_follows_what_the_node_does(
    gateway: StartGateway, children: Children, wait_until: WaitUntil
) -> None:
    running = gateway(sources())
    node = children.node("beacon_sensor")
    body = running.becomes(CARRIERS, "active")
    assert (body["process_id"], body["process_name"]) == (node.pid, "beacon_sensor.py")
    assert body["metadata"] == {"mode": "measuring"}
    assert children.node("param_set", "/temp_sensor", "mode", "calibrating").ends() == 0
    wait_until(lambda: running.get(CARRIERS)[1]["metadata"] == {"mode": "calibrating"})


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("program", ["tidy", "careless"])
def test_a_node_with_a_beacon_has_left_once_it_is_told_to_stop(
    program: str, number: signal.Signals, gateway: StartGateway, children: Children
) -> None:
    running = gateway(sources(ttl_s=300.0))
    node = children.node("beacon_sensor", program)
    running.becomes(OURS, "active")
    node.signal(number)
    node.ends()
    running.becomes(OURS, "left", within_s=15.0)


def test_an_announced_entity_is_active_and_has_left_after_ctrl_c(
    gateway: StartGateway, children: Children
) -> None:
    running = gateway(sources(ttl_s=30.0))
    # Once a minute: what a gateway hears of it, it hears because announcers tell newcomers.
    announcer = children.beacon(
        *("announce", "--adapter", "ros_topic", "--entity-id", "temp_sensor"),
        *("--display-name", "Temperature", "--period", "60"),
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
