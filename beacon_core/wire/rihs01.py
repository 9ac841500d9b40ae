"""RIHS01: the hash by which ROS 2 tells whether two programs have the same definition of a type.

``RIHS01_`` and the SHA-256 of a description of the type, and of all types in it, as JSON: names and
types of the fields in their order, and nothing else. Constants, defaults and comments do not count.
A service is described as a type with three fields (request, response, and the event that tells of
a call), an action as one with six.

Here the description is made from the text of ``.msg``, ``.srv`` and ``.action`` files. Two things
that the texts do not show: ``char`` is an unsigned byte, and a message without fields has one.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping

import attrs

from beacon_core.errors import UsageError

__all__ = ["type_hash"]


def type_hash(type_name: str, definition: str, others: Mapping[str, str] | None = None) -> str:
    """The hash of a type such as ``std_msgs/msg/String``, ``.../srv/...`` or ``.../action/...``.

    ``definition`` is the text of its file. ``others`` has the texts of the messages that it is made
    of, and of what these are made of, by their names; what every service and action needs is known
    here. Raises ``UsageError``, naming type and line, for a definition that is none, and for a type
    that is missing in ``others``. Thread rule: any thread.
    """
    types = _Types(others or {})
    types.define(type_name, definition)
    return "RIHS01_" + hashlib.sha256(json.dumps(types.described(type_name)).encode()).hexdigest()


_NESTED = 1
_BASIC = {
    name: number
    for number, name in enumerate(
        ["int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"], start=2
    )
} | {"char": 3, "float32": 10, "float64": 11, "bool": 15, "byte": 16, "string": 17, "wstring": 18}
_BOUNDED_STRING = 4
"""What is added for a bound of the text."""
_ARRAY, _BOUNDED, _UNBOUNDED = 48, 96, 144
"""What is added for an array, a sequence with a bound, and one without."""

_TIME = "builtin_interfaces/msg/Time"
_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
_UUID = "unique_identifier_msgs/msg/UUID"
_STANDARD = {
    _TIME: "int32 sec\nuint32 nanosec",
    _EVENT_INFO: "uint8 event_type\nbuiltin_interfaces/Time stamp\nchar[16] client_gid\n"
    "int64 sequence_number",
    _UUID: "uint8[16] uuid",
}

_TYPE_NAME = re.compile(r"([a-z][a-z0-9_]*)/(msg|srv|action)/([A-Z][A-Za-z0-9]*)")
_LINE = re.compile(
    r"(?P<type>[a-zA-Z][a-zA-Z0-9_/]*)(<=(?P<text_bound>[1-9][0-9]{0,9}))?"
    r"(?P<array>\[((?P<at_most><=)?(?P<length>[1-9][0-9]{0,9}))?\])?"
    r"\s+(?P<name>[a-zA-Z][a-zA-Z0-9_]*)\s*(?P<constant>=)?.*"
)
_REFERENCE = re.compile(r"(([a-z][a-z0-9_]*)/(msg/)?)?([A-Z][A-Za-z0-9]*)")
_SEPARATOR = "---"


@attrs.frozen
class _Field:
    name: str
    type_id: int
    capacity: int = 0
    string_capacity: int = 0
    nested: str = ""

    def described(self) -> dict[str, object]:
        return {
            "name": self.name,
            "type": {
                "type_id": self.type_id,
                "capacity": self.capacity,
                "string_capacity": self.string_capacity,
                "nested_type_name": self.nested,
            },
        }


_Fields = list[_Field]
_NO_FIELDS = [_Field("structure_needs_at_least_one_member", _BASIC["uint8"])]


class _Types:
    """Types by name, each read when it is needed."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = {**_STANDARD, **texts}
        self._fields: dict[str, _Fields] = {}

    def define(self, type_name: str, text: str) -> None:
        named = _TYPE_NAME.fullmatch(type_name)
        if named is None:
            raise UsageError(f"{type_name!r} is no type; write one like 'std_msgs/msg/String'")
        sections = _sections(text)
        wanted = {"msg": 1, "srv": 2, "action": 3}[named[2]]
        if len(sections) != wanted:
            raise UsageError(
                f"{type_name}: {len(sections) - 1} lines of '{_SEPARATOR}'; {wanted - 1} are right"
            )
        read = [_fields(type_name, lines) for lines in sections]
        if named[2] == "msg":
            self._fields[type_name] = read[0]
        elif named[2] == "srv":
            self._add_service(type_name, *read)
        else:
            self._add_action(type_name, *read)

    def described(self, type_name: str) -> dict[str, object]:
        names: set[str] = set()
        waiting = [type_name]
        while waiting:
            for field in self._of(waiting.pop()):
                if field.nested and field.nested not in names:
                    names.add(field.nested)
                    waiting.append(field.nested)
        return {
            "type_description": self._one(type_name),
            "referenced_type_descriptions": [self._one(name) for name in sorted(names)],
        }

    def _one(self, type_name: str) -> dict[str, object]:
        fields = [field.described() for field in self._of(type_name)]
        return {"type_name": type_name, "fields": fields}

    def _of(self, type_name: str) -> _Fields:
        if type_name not in self._fields:
            if type_name not in self._texts:
                raise UsageError(f"{type_name}: it is needed, and its definition is not given")
            self.define(type_name, self._texts[type_name])
        return self._fields[type_name]

    def _add_service(self, name: str, request: _Fields, response: _Fields) -> None:
        parts = {"request": f"{name}_Request", "response": f"{name}_Response"}
        self._fields[parts["request"]] = request
        self._fields[parts["response"]] = response
        self._fields[f"{name}_Event"] = [
            _nested("info", _EVENT_INFO),
            *[_Field(part, _NESTED + _BOUNDED, 1, nested=of) for part, of in parts.items()],
        ]
        self._fields[name] = [
            _nested(f"{part}_message", f"{name}_{part.title()}")
            for part in ("request", "response", "event")
        ]

    def _add_action(self, name: str, goal: _Fields, result: _Fields, feedback: _Fields) -> None:
        self._fields[f"{name}_Goal"] = goal
        self._fields[f"{name}_Result"] = result
        self._fields[f"{name}_Feedback"] = feedback
        goal_id = _nested("goal_id", _UUID)
        self._add_service(
            f"{name}_SendGoal",
            [goal_id, _nested("goal", f"{name}_Goal")],
            [_Field("accepted", _BASIC["bool"]), _nested("stamp", _TIME)],
        )
        self._add_service(
            f"{name}_GetResult",
            [goal_id],
            [_Field("status", _BASIC["int8"]), _nested("result", f"{name}_Result")],
        )
        self._fields[f"{name}_FeedbackMessage"] = [
            goal_id,
            _nested("feedback", f"{name}_Feedback"),
        ]
        self._fields[name] = [
            _nested("goal", f"{name}_Goal"),
            _nested("result", f"{name}_Result"),
            _nested("feedback", f"{name}_Feedback"),
            _nested("send_goal_service", f"{name}_SendGoal"),
            _nested("get_result_service", f"{name}_GetResult"),
            _nested("feedback_message", f"{name}_FeedbackMessage"),
        ]


def _nested(name: str, type_name: str) -> _Field:
    return _Field(name, _NESTED, nested=type_name)


def _sections(text: str) -> list[list[str]]:
    sections: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.rstrip() == _SEPARATOR:
            sections.append([])
        else:
            sections[-1].append(line)
    return sections


def _fields(type_name: str, lines: Iterable[str]) -> _Fields:
    return list(_read(type_name, lines)) or _NO_FIELDS


def _read(type_name: str, lines: Iterable[str]) -> Iterator[_Field]:
    for line in lines:
        meant = line.partition("#")[0].strip()
        if not meant:
            continue
        found = _LINE.fullmatch(meant)
        field = _field(type_name.partition("/")[0], found) if found else None
        if found is None or field is None:
            raise UsageError(f"{type_name}: {meant!r} defines no field and no constant")
        if not found["constant"]:
            yield field


def _field(package: str, found: re.Match[str]) -> _Field | None:
    kind, length, nested = found["type"], int(found["length"] or 0), ""
    type_id = _BASIC.get(kind)
    bound = int(found["text_bound"] or 0)
    if type_id is None:
        reference = _REFERENCE.fullmatch(kind)
        if reference is None:
            return None
        nested = f"{reference[2] or package}/msg/{reference[4]}"
        type_id = _NESTED
    if bound:
        if kind not in ("string", "wstring"):
            return None
        type_id += _BOUNDED_STRING
    if found["array"]:
        type_id += _UNBOUNDED if not length else _BOUNDED if found["at_most"] else _ARRAY
    return _Field(found["name"], type_id, length, bound, nested)
