"""What an announced entity's node answers, and what it tells of its changes."""

from __future__ import annotations

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, PREFIX, Value, write
from beacon_zenoh.rmw_param import messages
from beacon_zenoh.rmw_param.messages import ListRequest
from beacon_zenoh.rmw_param.services import SERVICES
from beacon_zenoh.rmw_param.voices import Voice, answer

NAMES: dict[str, Value] = {"a": "1", "a.b": "2", "a.b.c": "3", "ab": "4"}


def listed(*prefixes: str, depth: int = 0) -> list[str] | None:
    request = messages.encode_list_request(ListRequest(prefixes, depth))
    said = answer("list_parameters", NAMES, request)
    assert said is not None
    return messages.decode_list_response(said)


def test_all_are_listed_or_those_below_a_prefix() -> None:
    assert listed() == ["a", "a.b", "a.b.c", "ab"]
    assert listed("a") == ["a", "a.b", "a.b.c"]
    assert listed("a.b", "ab") == ["a.b", "a.b.c", "ab"]
    assert listed("c") == []


def test_a_depth_leaves_out_what_is_deeper() -> None:
    assert listed(depth=1) == ["a", "ab"]
    assert listed("a", depth=1) == ["a", "a.b"]


def got(*names: str) -> list[object] | None:
    said = answer("get_parameters", NAMES, messages.encode_names(names))
    assert said is not None
    return messages.decode_values(said)


def test_values_come_in_the_order_asked_and_again_if_asked_again() -> None:
    assert got("ab", "a", "ab") == ["4", "1", "4"]


def test_of_what_is_not_all_there_nothing_is_told() -> None:
    assert got("a", "missing") == []


@pytest.mark.parametrize("service", SERVICES, ids=lambda one: str(one.name))
@pytest.mark.parametrize("request_", [b"", b"\0\1\0\0", b"\0\1\0\0\xff\xff\xff\xff"])
def test_a_request_that_is_none_gets_no_answer(service: object, request_: bytes) -> None:
    assert answer(service.name, NAMES, request_) is None  # type: ignore[attr-defined]


def test_what_is_said_anew_is_told_by_what_became_of_it() -> None:
    voice = Voice("/e1")
    first = voice.say(write(BeaconHint("engine", display_name="cold", hostname="robot")))
    assert list(first.new)[-1] == ENTITY_ID
    assert not first.changed
    second = voice.say(write(BeaconHint("engine", display_name="warm", process_name="x")))
    assert second.changed == {f"{PREFIX}.display_name": "warm"}
    assert second.new == {f"{PREFIX}.process_name": "x"}
    assert second.deleted == [f"{PREFIX}.hostname"]


def test_who_is_withdrawn_has_no_parameters_and_speaks_when_it_says_something() -> None:
    voice = Voice("/e1")
    voice.say(write(BeaconHint("engine", hostname="robot")))
    event = voice.withdraw(7)
    assert event.changed == {ENTITY_ID: ""}
    assert event.deleted == [f"{PREFIX}.hostname"]
    assert (voice.parameters, voice.withdrawn_ns) == ({}, 7)
    voice.say(write(BeaconHint("engine")))
    assert voice.withdrawn_ns == 0
