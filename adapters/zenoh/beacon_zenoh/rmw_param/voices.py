"""What is said of each entity, as parameters of a node of its own; without Zenoh."""

from __future__ import annotations

from collections.abc import Mapping

import attrs

from beacon_core.parameters.fields import ENTITY_ID, Value
from beacon_zenoh.rmw_param import messages
from beacon_zenoh.rmw_param.messages import Event, ListRequest

__all__ = ["Parameters", "Voice", "answer"]

Parameters = Mapping[str, Value]
"""By their full names."""

_READ_ONLY = "read-only: it says what its announcer was told"


@attrs.define(eq=False)
class Voice:
    """An entity's node, and its parameters."""

    node_name: str
    parameters: Mapping[str, Value] = attrs.field(factory=dict)
    withdrawn_ns: int = 0
    """When it fell silent; 0: it still speaks."""
    asked_ns: int = 0
    """When it was last asked for its parameters; 0: never."""

    def say(self, parameters: Mapping[str, Value]) -> Event:
        """Have these parameters from now on. Returns what it tells others."""
        before, self.parameters = self.parameters, parameters
        self.withdrawn_ns = 0
        return Event(
            self.node_name,
            new={name: value for name, value in parameters.items() if name not in before},
            changed={
                name: value
                for name, value in parameters.items()
                if name in before and before[name] != value
            },
            deleted=[name for name in before if name not in parameters],
        )

    def withdraw(self, now_ns: int) -> Event:
        """Have none any more. The entity id is emptied, as whoever listens for ROS's own nodes is
        used to."""
        gone, self.parameters = self.parameters, {}
        self.withdrawn_ns = now_ns
        return Event(
            self.node_name,
            changed={ENTITY_ID: ""},
            deleted=[name for name in gone if name != ENTITY_ID],
        )


def answer(service: str, parameters: Parameters, request: bytes) -> bytes | None:
    """What a node with these parameters answers to one of the six services, given by its last name;
    ``None`` for a request that is none. Any bytes in, never raises."""
    return _ANSWERS[service](parameters, request)


def _list(parameters: Parameters, request: bytes) -> bytes | None:
    wanted = messages.decode_list_request(request)
    return None if wanted is None else messages.encode_list_response(_listed(parameters, wanted))


def _get(parameters: Parameters, request: bytes) -> bytes | None:
    named = _named(parameters, request)
    return None if named is None else messages.encode_values([value for _, value in named])


def _types(parameters: Parameters, request: bytes) -> bytes | None:
    named = _named(parameters, request)
    return None if named is None else messages.encode_types([value for _, value in named])


def _describe(parameters: Parameters, request: bytes) -> bytes | None:
    named = _named(parameters, request)
    return None if named is None else messages.encode_descriptions(named)


def _set(_: Parameters, request: bytes) -> bytes | None:
    names = messages.decode_settings(request)
    return None if names is None else messages.encode_refusals(len(names), _READ_ONLY)


def _set_atomically(_: Parameters, request: bytes) -> bytes | None:
    names = messages.decode_settings(request)
    return None if names is None else messages.encode_refusal(_READ_ONLY)


_ANSWERS = {
    "list_parameters": _list,
    "get_parameters": _get,
    "get_parameter_types": _types,
    "describe_parameters": _describe,
    "set_parameters": _set,
    "set_parameters_atomically": _set_atomically,
}


def _named(parameters: Parameters, request: bytes) -> list[tuple[str, Value]] | None:
    """Those that are asked for. As with nodes of ROS: if one is not there, none is told."""
    names = messages.decode_names(request)
    if names is None:
        return None
    there = all(name in parameters for name in names)
    return [(name, parameters[name]) for name in names] if there else []


def _listed(parameters: Parameters, wanted: ListRequest) -> list[str]:
    """As rclcpp does, which knows a prefix by the dot behind it."""
    if not wanted.prefixes:
        return [name for name in parameters if _within(name, wanted.depth)]
    return [
        name
        for name in parameters
        if any(
            name == prefix
            or (name.startswith(f"{prefix}.") and _within(name[len(prefix) + 1 :], wanted.depth))
            for prefix in wanted.prefixes
        )
    ]


def _within(name: str, depth: int) -> bool:
    return not depth or name.count(".") < depth
