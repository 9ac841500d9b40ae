"""Messages of parameter services: rclpy's own bytes are read, and what we write is read back."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.parameters.fields import Value
from beacon_zenoh.rmw_param import messages
from beacon_zenoh.rmw_param.messages import Event, ListRequest

CAPTURED = [
    json.loads(line)
    for line in (Path(__file__).parents[3] / "data" / "rmw_zenoh" / "parameters.jsonl")
    .read_text("utf-8")
    .splitlines()
]

READ: dict[str, Callable[[bytes], Any]] = {
    "ListParameters.Request": messages.decode_list_request,
    "ListParameters.Response": messages.decode_list_response,
    "GetParameters.Request": messages.decode_names,
    "GetParameters.Response": messages.decode_values,
    "SetParameters.Request": messages.decode_settings,
    "ParameterEvent": messages.decode_event,
}


def plain(value: Any) -> Any:
    """As JSON has it."""
    if attrs.has(type(value)):
        value = attrs.asdict(value)
    return json.loads(json.dumps(value, default=lambda one: bytes(one).decode()))


@pytest.mark.parametrize("captured", CAPTURED, ids=lambda one: str(one["message"]))
def test_what_rclpy_wrote_is_read(captured: dict[str, Any]) -> None:
    read = READ[captured["message"]](bytes.fromhex(captured["payload"]))
    assert plain(read) == captured["means"]


@pytest.mark.parametrize("captured", CAPTURED, ids=lambda one: str(one["message"]))
def test_what_is_cut_off_is_no_message_and_what_is_damaged_never_raises(
    captured: dict[str, Any],
) -> None:
    payload, read = bytes.fromhex(captured["payload"]), READ[captured["message"]]
    assert [read(payload[:end]) for end in range(8)] == [None] * 8
    for at in range(len(payload)):
        read(payload[:at])
        for byte in (0, 0x7F, 0xFF):
            read(payload[:at] + bytes([byte]) + payload[at + 1 :])


def test_what_is_asked_is_read_back() -> None:
    request = ListRequest(("ros2_medkit.discovery", ""), 2**63)
    assert messages.decode_list_request(messages.encode_list_request(request)) == request
    assert messages.decode_names(messages.encode_names(["a", "b"])) == ["a", "b"]


def test_what_is_answered_is_read_back() -> None:
    values: list[Value | None] = ["a", "", 0, -(2**63), 2**63 - 1, [], ["x", ""], None]
    assert messages.decode_values(messages.encode_values(values)) == values
    assert messages.decode_list_response(messages.encode_list_response(["a.b", "c"])) == [
        "a.b",
        "c",
    ]


def test_an_event_is_read_back() -> None:
    event = Event("/arm/driver", {"n": "v"}, {"c": ["x"], "i": 7}, ["d"])
    assert messages.decode_event(messages.encode_event(event, 1_500_000_000)) == event


def test_a_value_of_a_type_that_is_none_is_not_set() -> None:
    payload = bytearray(messages.encode_values(["a"]))
    payload[8] = 10
    assert messages.decode_values(bytes(payload)) == [None]


def test_a_count_that_is_a_lie_costs_nothing() -> None:
    for read in READ.values():
        assert read(b"\0\1\0\0" + b"\xff" * 64) is None
