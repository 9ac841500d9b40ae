"""A hint as parameters of a node, and back: one parameter per field, one per metadata entry.

``ros2_medkit.discovery.entity_id`` is the one that must be there; without it, or with an empty one,
a node says nothing. What has a wrong type, and what is no field of a hint, is left out and
reported. Values are as Python has them: ``str``, ``int``, ``list[str]`` and others.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs

from beacon_core.hint import NO_METADATA, BeaconHint
from beacon_core.limits import MAX_PROCESS_ID
from beacon_core.repairs import mended
from beacon_core.text import quoted
from beacon_core.wire.common import process_id_of

__all__ = ["ENTITY_ID", "MAX_PARAMETERS", "PREFIX", "Reading", "Value", "is_ours", "read", "write"]

PREFIX = "ros2_medkit.discovery"
"""What the names of all these parameters begin with; ros2_medkit reads the same."""

ENTITY_ID = f"{PREFIX}.entity_id"
"""Without it, or with an empty one, a node says nothing."""

MAX_PARAMETERS = 500
"""Parameters that one node is asked for: eight times what a hint has. So a node that declares a
million does not make the gateway ask for a million values."""

Value = str | int | list[str]
"""What the parameters of a hint are."""


@attrs.frozen
class Reading:
    """What a node's parameters say."""

    hint: BeaconHint | None
    """``None``: nothing."""
    skipped: tuple[str, ...] = ()
    """What was left out and why, each fit for a line of a log."""


def is_ours(name: str) -> bool:
    """Can a parameter of this name be a part of a hint?"""
    return name.startswith(_BEGINNING)


def read(parameters: Mapping[str, object]) -> Reading:
    """The hint in a node's parameters, given by their full names; others are ignored, and so are
    those without a value (``None``).

    Never raises, whatever the values. Ids and lengths are the validator's business.
    """
    fields: dict[str, Any] = {}
    metadata: dict[str, str] = {}
    skipped = []
    for name, value in parameters.items():
        if not is_ours(name) or value is None:
            continue
        field, _, key = name[len(_BEGINNING) :].partition(".")
        complaint = _complaint(field, key, value)
        if complaint:
            skipped.append(f"{quoted(name)}: {complaint}")
        elif key:
            metadata[key] = str(value)
        else:
            fields[field] = tuple(value) if isinstance(value, list | tuple) else value
    # An empty one is a hint that was taken back.
    if fields.get("entity_id"):
        return Reading(BeaconHint(**fields, metadata=metadata or NO_METADATA), tuple(skipped))
    if (fields or metadata) and parameters.get(ENTITY_ID) is None:
        skipped.append(f"{ENTITY_ID}: not given, so nobody knows whom the others are about")
    return Reading(None, tuple(skipped))


def write(hint: BeaconHint) -> dict[str, Value]:
    """The parameters that say this, by their full names: what is given, ``entity_id`` last.

    Whoever declares them in this order says nothing before all is said. A ROS string is UTF-8 and
    ends at a NUL, so NULs and lone surrogates become U+FFFD. Raises
    :class:`beacon_core.errors.UsageError` for a ``process_id`` outside 0..2^32-1.
    """
    given: dict[str, Value] = {
        **{field: _clean(getattr(hint, field)) for field in _TEXTS[1:]},
        **{field: [_clean(one) for one in getattr(hint, field)] for field in _LISTS},
        "process_id": process_id_of(hint),
    }
    parameters = {_BEGINNING + field: value for field, value in given.items() if value}
    for key, text in hint.metadata.items():
        parameters[f"{_BEGINNING}metadata.{_clean(key)}"] = _clean(text)
    parameters[ENTITY_ID] = _clean(hint.entity_id)
    return parameters


_BEGINNING = f"{PREFIX}."
_TEXTS = (
    "entity_id",
    "stable_id",
    "display_name",
    "component_id",
    "transport_type",
    "negotiated_format",
    "process_name",
    "hostname",
)
_LISTS = ("function_ids", "depends_on")


def _complaint(field: str, key: str, value: object) -> str:
    """Why this cannot be used; ``""`` if it can."""
    if field == "metadata" and key:
        return "" if isinstance(value, str) else _expected("a string", value)
    if key:
        return "no field of a hint"
    if field in _TEXTS:
        return "" if isinstance(value, str) else _expected("a string", value)
    if field in _LISTS:
        return "" if _are_texts(value) else _expected("an array of strings", value)
    if field == "process_id":
        # bool is a subclass of int, and no number.
        fits = type(value) is int and 0 <= value <= MAX_PROCESS_ID
        return "" if fits else _expected(f"an integer 0..{MAX_PROCESS_ID}", value)
    return "no field of a hint"


def _are_texts(value: object) -> bool:
    return isinstance(value, list | tuple) and all(isinstance(one, str) for one in value)


def _expected(wanted: str, value: object) -> str:
    if type(value) is int:
        return f"expected {wanted}, found {value}"
    return f"expected {wanted}, found {_NAMES.get(type(value), 'an array')}"


_NAMES: Mapping[type, str] = {bool: "a boolean", float: "a double", str: "a string"}


def _clean(text: str) -> str:
    return mended(text).replace("\0", "\N{REPLACEMENT CHARACTER}")
