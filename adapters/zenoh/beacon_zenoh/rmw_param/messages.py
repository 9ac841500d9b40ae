"""Requests, responses and events of ROS's parameters: ``rcl_interfaces`` in plain CDR.

What encodes is for our own values. What decodes takes any bytes, never raises, and gives ``None``
for what is no such message. A value that is not set is ``None``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TypeVar

import attrs

from beacon_core.parameters.fields import Value
from beacon_zenoh.rmw_param.cdr import NoMessageError, Reader, Writer

__all__ = [
    "Event",
    "ListRequest",
    "decode_event",
    "decode_list_request",
    "decode_list_response",
    "decode_names",
    "decode_settings",
    "decode_values",
    "encode_descriptions",
    "encode_event",
    "encode_list_request",
    "encode_list_response",
    "encode_names",
    "encode_refusal",
    "encode_refusals",
    "encode_types",
    "encode_values",
]

_M = TypeVar("_M")

_NOT_SET, _INTEGER, _STRING, _STRINGS = 0, 2, 4, 9
"""Of ``ParameterType``, what parameters of hints are."""

_LEAST_TEXT = 4
_LEAST_VALUE = 48
"""Bytes of a ``ParameterValue`` without anything in it, but for padding."""


@attrs.frozen
class ListRequest:
    """``ListParameters.Request``."""

    prefixes: tuple[str, ...] = ()
    depth: int = 0
    """How many levels below a prefix; 0: all."""


@attrs.frozen
class Event:
    """``ParameterEvent``, but for its stamp."""

    node: str
    new: Mapping[str, object] = attrs.field(factory=dict)
    changed: Mapping[str, object] = attrs.field(factory=dict)
    deleted: Collection[str] = ()


# -- list_parameters


def encode_list_request(request: ListRequest) -> bytes:
    """For whoever asks."""
    writer = Writer()
    writer.texts(request.prefixes)
    writer.numbers("Q", (request.depth,))
    return writer.message()


def decode_list_request(payload: bytes) -> ListRequest | None:
    """For whoever answers."""
    return _read(payload, lambda reader: ListRequest(tuple(reader.texts()), reader.number("Q")))


def encode_list_response(names: Sequence[str]) -> bytes:
    """The names, and what is before the last dot in each."""
    writer = Writer()
    writer.texts(names)
    writer.texts(list(dict.fromkeys(name.rpartition(".")[0] for name in names if "." in name)))
    return writer.message()


def decode_list_response(payload: bytes) -> list[str] | None:
    """The names."""
    return _read(payload, Reader.texts)


# -- get_parameters, get_parameter_types, describe_parameters


def encode_names(names: Sequence[str]) -> bytes:
    """The request of all three."""
    writer = Writer()
    writer.texts(names)
    return writer.message()


def decode_names(payload: bytes) -> list[str] | None:
    """The same."""
    return _read(payload, Reader.texts)


def encode_values(values: Collection[Value | None]) -> bytes:
    """What ``get_parameters`` answers."""
    writer = Writer()
    writer.count(len(values))
    for value in values:
        _write_value(writer, value)
    return writer.message()


def decode_values(payload: bytes) -> list[object] | None:
    """The same."""
    return _read(
        payload, lambda reader: [_value(reader) for _ in range(reader.count(_LEAST_VALUE))]
    )


def encode_types(values: Collection[Value | None]) -> bytes:
    """What ``get_parameter_types`` answers."""
    writer = Writer()
    writer.sequence("B", [_type(value) for value in values])
    return writer.message()


def encode_descriptions(parameters: Sequence[tuple[str, Value | None]]) -> bytes:
    """What ``describe_parameters`` answers: they are read-only."""
    writer = Writer()
    writer.count(len(parameters))
    for name, value in parameters:
        writer.text(name)
        writer.numbers("B", (_type(value),))
        for _ in range(2):  # description, and constraints in words
            writer.text("")
        writer.numbers("B", (True, False))  # read-only; of one type
        writer.count(0)  # no range of floats
        writer.count(0)  # nor of integers
    return writer.message()


# -- set_parameters, set_parameters_atomically


def decode_settings(payload: bytes) -> list[str] | None:
    """The names of what somebody wants to set: the request of both."""
    return _read(payload, lambda reader: [name for name, _ in _parameters(reader)])


def encode_refusals(count: int, reason: str) -> bytes:
    """What ``set_parameters`` answers: no, to each."""
    writer = Writer()
    writer.count(count)
    for _ in range(count):
        _write_refusal(writer, reason)
    return writer.message()


def encode_refusal(reason: str) -> bytes:
    """What ``set_parameters_atomically`` answers: no."""
    writer = Writer()
    _write_refusal(writer, reason)
    return writer.message()


# -- /parameter_events


def encode_event(event: Event, stamp_ns: int) -> bytes:
    """``stamp_ns``: wall-clock time of the event, nanoseconds since 1970."""
    writer = Writer()
    writer.numbers("I", divmod(stamp_ns, 10**9))
    writer.text(event.node)
    for parameters in (event.new, event.changed, dict.fromkeys(event.deleted)):
        writer.count(len(parameters))
        for name, value in parameters.items():
            writer.text(name)
            _write_value(writer, value)
    return writer.message()


def decode_event(payload: bytes) -> Event | None:
    """The same."""
    return _read(payload, _event)


def _read(payload: bytes, read: Callable[[Reader], _M]) -> _M | None:
    try:
        return read(Reader(payload))
    except NoMessageError:
        return None


def _event(reader: Reader) -> Event:
    reader.numbers("I", 2)
    node = reader.text()
    new, changed = dict(_parameters(reader)), dict(_parameters(reader))
    return Event(node, new, changed, [name for name, _ in _parameters(reader)])


def _parameters(reader: Reader) -> list[tuple[str, object]]:
    count = reader.count(_LEAST_TEXT + _LEAST_VALUE)
    return [(reader.text(), _value(reader)) for _ in range(count)]


def _value(reader: Reader) -> object:
    """``ParameterValue``: a type, and a value of each type, of which one counts."""
    kind = reader.number("B")
    values: tuple[object, ...] = (
        None,
        bool(reader.number("B")),
        reader.number("q"),
        reader.floats(1)[0],
        reader.text(),
        bytes(reader.numbers("B", reader.count(1))),
        [bool(one) for one in reader.numbers("B", reader.count(1))],
        list(reader.numbers("q", reader.count(8))),
        list(reader.floats(reader.count(8))),
        reader.texts(),
    )
    return values[kind] if kind < len(values) else None


def _write_value(writer: Writer, value: object) -> None:
    kind = _type(value)
    writer.numbers("B", (kind, False))
    writer.numbers("q", (value if isinstance(value, int) else 0,))
    writer.numbers("d", (0.0,))
    writer.text(value if isinstance(value, str) else "")
    for _ in range(4):  # bytes, booleans, integers, floats
        writer.count(0)
    writer.texts(value if isinstance(value, list) else ())


def _type(value: object) -> int:
    if isinstance(value, str):
        return _STRING
    if isinstance(value, int):
        return _INTEGER
    return _STRINGS if isinstance(value, list) else _NOT_SET


def _write_refusal(writer: Writer, reason: str) -> None:
    writer.numbers("B", (False,))
    writer.text(reason)
