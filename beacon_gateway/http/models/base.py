"""How a body becomes JSON: the names of its keys, and what is left out.

A field's key is its name, unless it says otherwise (:func:`key`). A field whose default is ``None``
is left out while it is ``None``: clients never see a null. The OpenAPI document is made from the
same fields (:mod:`beacon_gateway.http.schemas`), so the two cannot differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import attrs
import cattrs
from cattrs.gen import make_dict_unstructure_fn, override

__all__ = ["Open", "as_plain", "is_opaque", "key", "key_of", "opaque", "optional_key"]

_T = TypeVar("_T", bound=type)

Open = Mapping[str, object]
"""A part that each answer fills as it needs; any keys."""


def key(name: str) -> Any:
    """A field that must be given and is called ``name`` in JSON."""
    return attrs.field(metadata={"key": name})


def optional_key(name: str) -> Any:
    """A field that may be left out and is called ``name`` in JSON."""
    return attrs.field(default=None, metadata={"key": name})


def key_of(attribute: attrs.Attribute[Any]) -> str:
    """What a field is called in JSON."""
    named: str = attribute.metadata.get("key", attribute.name)
    return named


def opaque(cls: _T) -> _T:
    """Mark a body that clients take as it is: its schema promises no keys."""
    _opaque.add(cls)
    return cls


def is_opaque(cls: type) -> bool:
    """The schema of this body promises no keys."""
    return cls in _opaque


def as_plain(body: object) -> Any:
    """A body as what JSON knows: mappings, lists, texts, numbers."""
    return _converter.unstructure(body)


def _unstructured(cls: type[Any]) -> Callable[[Any], Any]:
    fields: dict[str, Any] = {
        attribute.name: override(
            rename=key_of(attribute), omit_if_default=attribute.default is None
        )
        for attribute in attrs.fields(cls)
    }
    return make_dict_unstructure_fn(cls, _converter, **fields)


_opaque: set[type] = set()
_converter = cattrs.Converter(detailed_validation=False)
_converter.register_unstructure_hook_factory(attrs.has, _unstructured)
