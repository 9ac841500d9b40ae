"""The bytes of parameter services: ROS reads what we write, and we read what ROS writes."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no ROS to compare with")

from hypothesis import given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import ListParametersResult, ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.serialization import deserialize_message, serialize_message

from beacon_zenoh.rmw_param import messages
from beacon_zenoh.rmw_param.messages import Event, ListRequest

OFTEN = settings(max_examples=150, deadline=None)

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
integers = st.integers(-(2**63), 2**63 - 1)
ours = st.one_of(texts, integers, st.lists(texts, min_size=1, max_size=4))
anything = st.one_of(
    ours,
    st.none(),
    st.booleans(),
    st.floats(allow_nan=False),
    st.lists(st.booleans(), min_size=1, max_size=4),
    st.lists(integers, min_size=1, max_size=4),
    st.lists(st.floats(allow_nan=False), min_size=1, max_size=4),
)


def ros(value: Any) -> Any:
    return Parameter("x", value=value).get_parameter_value()


def written(message: Any) -> bytes:
    return bytes(serialize_message(message))


def read(payload: bytes, kind: Any) -> Any:
    return deserialize_message(payload, kind)


@OFTEN
@given(st.lists(texts, max_size=4), st.integers(0, 2**64 - 1))
def test_questions_are_the_same_to_both(names: list[str], depth: int) -> None:
    listing = ListParameters.Request(prefixes=names, depth=depth)
    mine = ListRequest(tuple(names), depth)
    assert messages.decode_list_request(written(listing)) == mine
    assert read(messages.encode_list_request(mine), ListParameters.Request) == listing
    getting = GetParameters.Request(names=names)
    assert messages.decode_names(written(getting)) == names
    assert read(messages.encode_names(names), GetParameters.Request) == getting


@OFTEN
@given(st.lists(anything, max_size=5))
def test_values_of_every_type_that_ros_writes_are_read(values: list[Any]) -> None:
    answer = GetParameters.Response(values=[ros(one) for one in values])
    assert messages.decode_values(written(answer)) == values


@OFTEN
@given(st.lists(ours, max_size=5), st.lists(texts, max_size=4))
def test_ros_reads_our_answers(values: list[Any], names: list[str]) -> None:
    got = read(messages.encode_values(values), GetParameters.Response)
    assert [parameter_value_to_python(one) for one in got.values] == values
    listed = read(messages.encode_list_response(names), ListParameters.Response)
    assert list(listed.result.names) == names
    types = read(messages.encode_types(values), GetParameterTypes.Response)
    assert list(types.types) == [ros(one).type for one in values]
    described = messages.encode_descriptions([("a", one) for one in values])
    descriptors = read(described, DescribeParameters.Response).descriptors
    assert [(one.name, one.type, one.read_only) for one in descriptors] == [
        ("a", ros(value).type, True) for value in values
    ]


@OFTEN
@given(st.lists(texts, max_size=4))
def test_we_read_the_lists_of_ros(names: list[str]) -> None:
    answer = ListParameters.Response(result=ListParametersResult(names=names, prefixes=names))
    assert messages.decode_list_response(written(answer)) == names


@OFTEN
@given(texts, st.dictionaries(texts, ours, max_size=3), st.lists(texts, unique=True, max_size=3))
def test_events_are_the_same_to_both(node: str, values: dict[str, Any], deleted: list[str]) -> None:
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    gone = [Parameter(name).to_parameter_msg() for name in deleted]
    event = ParameterEvent(
        node=node, new_parameters=parameters, changed_parameters=parameters, deleted_parameters=gone
    )
    mine = Event(node, values, values, deleted)
    assert messages.decode_event(written(event)) == mine
    assert read(messages.encode_event(mine, 0), ParameterEvent) == event


def test_refusals_say_so_to_ros() -> None:
    wanted = SetParameters.Request(
        parameters=[Parameter(name, value=1).to_parameter_msg() for name in "ab"]
    )
    assert messages.decode_settings(written(wanted)) == ["a", "b"]
    refused = read(messages.encode_refusals(2, "no"), SetParameters.Response).results
    one = read(messages.encode_refusal("no"), SetParametersAtomically.Response).result
    assert [(each.successful, each.reason) for each in (*refused, one)] == [(False, "no")] * 3
