"""What can be said of nodes that were asked for parameters, to somebody whose view is empty."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import islice

from beacon_core.parameters.fields import ENTITY_ID, PREFIX, read
from beacon_core.ports.examination import Finding, Level
from beacon_core.validator import is_valid_id

__all__ = ["Declared", "declarations"]

Declared = Mapping[str, object]
"""A node's parameters that belong to a hint, with their values."""

_SHOWN = 5
"""Nodes of a kind that are told one by one."""


def declarations(answers: Mapping[str, Declared | None], within_s: float) -> Iterator[Finding]:
    """Who does not answer, who declares what; by the nodes' names. ``None``: there was no answer
    within so many seconds."""
    yield from _silence(answers, within_s)
    yield from _declarations(answers)


def _silence(answers: Mapping[str, Declared | None], within_s: float) -> Iterator[Finding]:
    if silent := [name for name, declared in answers.items() if declared is None]:
        what = (
            f"no answer to list_parameters or get_parameters in {within_s:g} s: {_listed(silent)}"
        )
        yield Finding(Level.PROBLEM, what, "they hang, are stopped, or are not spun")


def _declarations(answers: Mapping[str, Declared | None]) -> Iterator[Finding]:
    speaking = {name: declared for name, declared in answers.items() if declared}
    faults = {name: why for name, declared in speaking.items() if (why := _fault(declared))}
    if well := speaking.keys() - faults.keys():
        said = _listed(f"{name} ({speaking[name][ENTITY_ID]})" for name in well)
        yield Finding(Level.OK, f"{PREFIX}.* is declared by {said}")
    for name, why in list(faults.items())[:_SHOWN]:
        what = f"{name} declares {PREFIX}.*, but {why}"
        yield Finding(Level.PROBLEM, what, f"declare {ENTITY_ID} with a text such as 'arm_driver'")
    if len(faults) > _SHOWN:
        yield Finding(Level.PROBLEM, f"so it is with {len(faults) - _SHOWN} more nodes")
    yield from islice(_left_out(speaking), _SHOWN)
    if not speaking and any(declared is not None for declared in answers.values()):
        advice = f"declare {ENTITY_ID} in the node's code or in its params file"
        yield Finding(Level.PROBLEM, f"no node declares {PREFIX}.*", advice)


def _fault(declared: Declared) -> str:
    """Why this is no hint; ``""`` if it is one."""
    if ENTITY_ID not in declared:
        return "not entity_id among them"
    value = declared[ENTITY_ID]
    if not isinstance(value, str):
        return f"entity_id is no text but {_kind(value)}"
    if not value:
        return "entity_id is empty"
    return "" if is_valid_id(value) else "entity_id is no id: 1 to 256 of A-Z a-z 0-9 _ -"


def _kind(value: object) -> str:
    return "not set" if value is None else f"of type {type(value).__name__}"


def _left_out(speaking: Mapping[str, Declared]) -> Iterator[Finding]:
    """What cannot be used besides."""
    for name, declared in speaking.items():
        skipped = [line for line in read(declared).skipped if ENTITY_ID not in line]
        if skipped:
            more = f" (and {len(skipped) - 1} more)" if len(skipped) > 1 else ""
            yield Finding(Level.NOTE, f"of {name} is left out: {skipped[0]}{more}")


def _listed(names: Iterable[str]) -> str:
    """The first few names, and how many more."""
    found = sorted(names)
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return ", ".join(found[:_SHOWN]) + more
