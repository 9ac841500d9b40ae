"""What an event says of a hint, and which run of a node is which."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no events")

from hypothesis import given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rclpy.serialization import serialize_message

from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_ros.participant import OwnNode
from beacon_ros_param.events import Change, change_in, runs

if TYPE_CHECKING:
    from tests.unit.beacon_ros_param.conftest import Peers

KINDS = ("new_parameters", "changed_parameters", "deleted_parameters")


def event(kind: str, name: str, value: str = "x") -> bytes:
    parameter = Parameter(name=name, value=ParameterValue(type=4, string_value=value))
    given: dict[str, Any] = {kind: [parameter]}
    return serialize_message(ParameterEvent(node="/engine", **given))


@pytest.mark.parametrize(
    ("kind", "value", "leaving"),
    [
        ("new_parameters", "engine", False),
        ("changed_parameters", "engine", False),
        ("changed_parameters", "", True),
        ("new_parameters", "", True),
        ("deleted_parameters", "engine", True),
        ("deleted_parameters", "", True),
    ],
)
def test_an_event_about_the_entity_id_tells_whether_the_hint_is_taken_back(
    kind: str, value: str, leaving: object
) -> None:
    assert change_in(event(kind, ENTITY_ID, value)) == Change("/engine", leaving)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", KINDS)
def test_an_event_about_another_field_says_that_something_changed(kind: str) -> None:
    assert change_in(event(kind, f"{PREFIX}.display_name", "")) == Change("/engine", None)


@pytest.mark.parametrize("kind", KINDS)
def test_an_event_about_anything_else_says_nothing(kind: str) -> None:
    assert change_in(event(kind, "use_sim_time")) is None


@settings(deadline=None)
@given(st.binary(max_size=80), st.integers(0, 120))
def test_any_bytes_are_survived(noise: bytes, cut: int) -> None:
    good = event("changed_parameters", ENTITY_ID)
    for payload in (noise, noise + PREFIX.encode(), good[:cut], good[:cut] + noise + good[cut:]):
        assert isinstance(change_in(payload), Change | None)


def test_each_run_of_a_node_has_a_gid_of_its_own(
    peers: Peers, domain_id: int, wait_for: Callable[..., None]
) -> None:
    own = OwnNode("events_test", domain_id)
    engine = peers.new("engine")
    wait_for(lambda: runs(own.node).get("/engine"), "the node is found, with a GID")
    (first,) = runs(own.node)["/engine"]
    peers.remove(engine)
    wait_for(lambda: "/engine" not in runs(own.node), "the node is gone")
    peers.new("engine")
    wait_for(lambda: runs(own.node).get("/engine"), "the node is back")
    (second,) = runs(own.node)["/engine"]
    assert first != second
    peers.new("engine")
    wait_for(lambda: len(runs(own.node)["/engine"]) == 2, "its namesake is found")
    assert second in runs(own.node)["/engine"]
    own.close()
