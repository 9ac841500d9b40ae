"""JSON schemas of the answers' bodies, made from the classes themselves."""

from __future__ import annotations

import collections.abc
import enum
import types
import typing
from typing import Any

import attrs

from beacon_gateway.http.models.base import is_opaque, key_of

__all__ = ["Schemas"]

_PLAIN: dict[object, dict[str, Any]] = {
    str: {"type": "string"},
    int: {"type": "integer"},
    float: {"type": "number"},
    bool: {"type": "boolean"},
    object: {},
    type(None): {"type": "null"},
}


class Schemas:
    """Collects the schemas of classes and of all they are made of, by name."""

    def __init__(self) -> None:
        self.by_name: dict[str, dict[str, Any]] = {}

    def reference(self, cls: type) -> dict[str, Any]:
        """A reference to the schema of a class, which is there from now on."""
        name = cls.__name__
        if name not in self.by_name:
            self.by_name[name] = {}  # so that a class may hold itself
            self.by_name[name] = self._of_class(cls)
        return {"$ref": f"#/components/schemas/{name}"}

    def _of_class(self, cls: type) -> dict[str, Any]:
        description = _first_paragraph(cls)
        if is_opaque(cls):
            return {
                **description,
                "type": "object",
                "additionalProperties": True,
                "x-medkit-opaque": True,
            }
        attrs.resolve_types(cls)
        fields = attrs.fields(cls)
        required = [key_of(field) for field in fields if field.default is attrs.NOTHING]
        return {
            **description,
            "type": "object",
            "properties": {key_of(field): self._of(field.type) for field in fields},
            **({"required": required} if required else {}),
        }

    def _of(self, kind: Any) -> dict[str, Any]:
        if kind in _PLAIN:
            return dict(_PLAIN[kind])
        if isinstance(kind, type) and issubclass(kind, enum.Enum):
            return {"type": "string", "enum": [member.value for member in kind]}
        if attrs.has(kind):
            return self.reference(kind)
        origin, arguments = typing.get_origin(kind), typing.get_args(kind)
        if origin is types.UnionType:
            return {"anyOf": [self._of(one) for one in arguments]}
        if origin is collections.abc.Mapping:
            return self._of_mapping(arguments[1])
        assert origin is collections.abc.Sequence, kind  # noqa: S101 - ours to see to
        return {"type": "array", "items": self._of(arguments[0])}

    def _of_mapping(self, value: Any) -> dict[str, Any]:
        if value is object:
            return {}
        return {"type": "object", "additionalProperties": self._of(value)}


def _first_paragraph(cls: type) -> dict[str, str]:
    text = (cls.__doc__ or "").partition("\n\n")[0]
    # attrs writes one where nobody did.
    if not text or text.startswith("Method generated"):
        return {}
    return {"description": " ".join(text.split())}
