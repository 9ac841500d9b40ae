"""Messages of parameter services: both ways for all values, and no bytes that raise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hypothesis import example, given, settings
from hypothesis import strategies as st

from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import read, write
from beacon_core.testing.strategies import hints
from beacon_zenoh.rmw_param import messages
from beacon_zenoh.rmw_param.messages import Event, ListRequest
from beacon_zenoh.rmw_param.services import SERVICES
from beacon_zenoh.rmw_param.voices import answer

OFTEN = settings(max_examples=300, deadline=None)

texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)
values = st.one_of(st.none(), texts, st.integers(-(2**63), 2**63 - 1), st.lists(texts, max_size=4))
parameters = st.dictionaries(texts, values, max_size=5)
written = st.dictionaries(texts, values.filter(lambda one: one is not None), max_size=5)

DECODERS: tuple[Callable[[bytes], Any], ...] = (
    messages.decode_event,
    messages.decode_list_request,
    messages.decode_list_response,
    messages.decode_names,
    messages.decode_settings,
    messages.decode_values,
)


@OFTEN
@given(st.lists(texts, max_size=5), st.integers(0, 2**64 - 1))
def test_a_question_is_read_back(names: list[str], depth: int) -> None:
    request = ListRequest(tuple(names), depth)
    assert messages.decode_list_request(messages.encode_list_request(request)) == request
    assert messages.decode_names(messages.encode_names(names)) == names
    assert messages.decode_list_response(messages.encode_list_response(names)) == names


@OFTEN
@given(st.lists(values, max_size=6), st.binary(max_size=9))
def test_values_are_read_back_whatever_is_behind_them(given_: list[Any], behind: bytes) -> None:
    assert messages.decode_values(messages.encode_values(given_) + behind) == given_


@OFTEN
@given(texts, parameters, parameters, st.lists(texts, unique=True, max_size=4))
def test_an_event_is_read_back(
    node: str, new: dict[str, Any], changed: dict[str, Any], deleted: list[str]
) -> None:
    event = Event(node, new, changed, deleted)
    assert messages.decode_event(messages.encode_event(event, 10**18)) == event


@OFTEN
@given(hints())
def test_a_hint_that_is_asked_for_is_the_hint_that_was_announced(hint: BeaconHint) -> None:
    declared = write(hint)
    everything = messages.encode_list_request(ListRequest())
    names = messages.decode_list_response(answer("list_parameters", declared, everything) or b"")
    assert names == list(declared)
    request = messages.encode_names(names)
    found = messages.decode_values(answer("get_parameters", declared, request) or b"")
    assert found is not None
    assert read(dict(zip(names, found, strict=True))) == read(declared)


@OFTEN
@given(st.binary(max_size=200), st.sampled_from([b"", b"\0\1\0\0", b"\0\0\0\0"]))
@example(b"\xff" * 64, b"\0\1\0\0")
def test_any_bytes_are_a_message_or_none(noise: bytes, header: bytes) -> None:
    for decode in DECODERS:
        decode(header + noise)
    for service in SERVICES:
        said = answer(service.name, {"a": "b"}, header + noise)
        assert said is None or said[:2] == b"\0\1"


@OFTEN
@given(written, st.data())
def test_a_damaged_message_never_raises(given_: dict[str, Any], data: st.DataObject) -> None:
    good = bytearray(messages.encode_event(Event("/n", given_, given_, list(given_)), 1))
    for at in data.draw(st.lists(st.integers(0, len(good) - 1), max_size=4)):
        good[at] = data.draw(st.integers(0, 255))
    end = data.draw(st.integers(0, len(good)))
    for decode in DECODERS:
        decode(bytes(good[:end]))
