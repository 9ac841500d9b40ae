"""The manifest: what somebody wrote down about the machine, in ros2_medkit's format (YAML).

Everything that is wrong with one is reported at once, each with its place; errors that ros2_medkit
knows too begin with its code (R001 ...). Keys that nobody knows are warned of and read past.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import attrs

from beacon_gateway.documents import read_yaml
from beacon_gateway.problems import DocumentError, Problem, near, shown, step
from beacon_gateway.structuring import Structurer
from beacon_gateway.tree.entities import Entity, Tree
from beacon_gateway.tree.entries import (
    AppEntry,
    AreaEntry,
    BindingEntry,
    ComponentEntry,
    FunctionEntry,
    PolicyEntry,
)
from beacon_gateway.tree.linker import Unmanifested
from beacon_gateway.tree.rules import Draft, Placed, errors, warnings

__all__ = ["Manifest", "load_manifest", "parse_manifest"]

_VERSION = "1.0"

_KEYS = ("manifest_version", "config", "areas", "components", "apps", "functions")

_UNUSED = frozenset({"metadata", "capabilities"})
_NOT_SERVED = frozenset({"assets", "scripts"})


@attrs.frozen
class Manifest:
    """A tree that is known beforehand, and how it is to be merged with what is found."""

    tree: Tree = attrs.Factory(Tree)
    unmanifested_nodes: Unmanifested | None = None
    """What becomes of ROS nodes that no app here is bound to; ``None``: nothing is said of it."""
    inherit_runtime_resources: bool = True
    """As given. Without topics and services in the tree there is nothing to inherit."""
    allow_manifest_override: bool = True
    """``False``: what is found counts as much as what is written here."""
    warnings: tuple[Problem, ...] = ()


def load_manifest(path: Path, *, strict: bool = False) -> Manifest:
    """Read a file. Raises ``ConfigError``: every problem at once, one per line."""
    return parse_manifest(read_yaml(path), strict=strict)


def parse_manifest(document: object, *, strict: bool = False) -> Manifest:
    """Structure what a file holds. ``strict``: its warnings are errors. Raises as
    ``load_manifest``."""
    structurer = Structurer()
    reader = _Reader(structurer)
    with structurer.at(""):
        reader.read(structurer.mapping(document, "keys with values, such as manifest_version"))
    draft = reader.draft()
    problems = [*structurer.problems, *_problems(errors(draft))]
    doubts = [*structurer.corrections, *_problems(warnings(draft))]
    if strict:
        problems += doubts
    if problems:
        raise DocumentError(problems)
    policy = reader.policy
    return Manifest(
        _tree(draft),
        policy.unmanifested_nodes,
        policy.inherit_runtime_resources,
        policy.allow_manifest_override,
        tuple(doubts),
    )


_T = TypeVar("_T")
_E = TypeVar("_E", bound=Entity)


class _Reader:
    """Reads entry by entry, so that one that is wrong does not hide what is wrong with others."""

    def __init__(self, structurer: Structurer) -> None:
        self._structurer = structurer
        self.policy = PolicyEntry()
        self._placed: dict[str, list[Placed[Any]]] = {key: [] for key in _KEYS[2:]}
        self._unreadable: set[str] = set()
        structurer.hook(BindingEntry, lambda value: self._lenient(value, BindingEntry))

    def read(self, given: Mapping[Any, object]) -> None:
        self._check_version(given.get("manifest_version"))
        self._check_keys(given)
        policies = [key for key in ("config", "discovery") if given.get(key) is not None]
        for key in policies[:1]:
            with self._structurer.at(step(key)):
                self.policy = self._lenient(given[key], PolicyEntry)
        self._areas(given.get("areas"), ".areas", "")
        self._entries(given.get("components"), "components", ComponentEntry)
        self._entries(given.get("apps"), "apps", AppEntry)
        self._entries(given.get("functions"), "functions", FunctionEntry)

    def draft(self) -> Draft:
        return Draft(**self._placed, unreadable=frozenset(self._unreadable))

    def _check_version(self, version: object) -> None:
        # YAML reads an unquoted 1.0 as a number.
        if str(version) != _VERSION:
            with self._structurer.at(".manifest_version"):
                self._structurer.note(f'R001: found {shown(version)}; give "{_VERSION}"')

    def _check_keys(self, given: Mapping[Any, object]) -> None:
        for key in given:
            with self._structurer.at(step(key)):
                if key in _NOT_SERVED:
                    self._structurer.correct("not served by this gateway; left out")
                elif key not in (*_KEYS, "discovery", *_UNUSED):
                    self._structurer.correct(f"unknown key; left out{near(key, _KEYS)}")

    def _areas(self, given: object, at: str, within: str) -> None:
        for place, value in self._items(given, at):
            entry = self._entry(value, place, AreaEntry)
            if entry is not None:
                self._placed["areas"].append(Placed(place, entry.entity(within)))
            if isinstance(value, Mapping):
                inner = "" if entry is None else entry.id
                self._areas(value.get("subareas"), f"{place}.subareas", inner)

    def _entries(
        self,
        given: object,
        key: str,
        cls: type[ComponentEntry | AppEntry | FunctionEntry],
    ) -> None:
        for place, value in self._items(given, f".{key}"):
            entry = self._entry(value, place, cls)
            if entry is not None:
                self._placed[key].append(Placed(place, entry.entity()))

    def _items(self, given: object, at: str) -> Iterator[tuple[str, object]]:
        if given is None:
            return
        if not isinstance(given, list | tuple):
            with self._structurer.at(at):
                self._structurer.note(f"found {shown(given)}; give a list")
            return
        yield from ((f"{at}[{index}]", value) for index, value in enumerate(given))

    def _entry(self, value: object, place: str, cls: type[_T]) -> _T | None:
        with self._structurer.at(place):
            return self._lenient(value, cls)
        # Something is wrong with it, and has been noted.
        if isinstance(value, Mapping):
            self._unreadable.add(str(value.get("id")))
        return None

    def _lenient(self, value: object, cls: type[_T]) -> _T:
        """As the class, but unknown keys are read past, and a key without a value is not given."""
        given = self._structurer.mapping(value)
        known = [field.name for field in attrs.fields(cls)]  # type: ignore[arg-type]
        unused: frozenset[str] = cls.unused  # type: ignore[attr-defined]
        for key in given:
            if key not in known and key not in unused:
                with self._structurer.at(step(key)):
                    self._structurer.correct(f"unknown key; left out{near(key, known)}")
        kept = {key: item for key, item in given.items() if key in known and item is not None}
        return self._structurer.fields(kept, cls)


def _problems(found: Iterator[tuple[str, str]]) -> list[Problem]:
    return [Problem(f"${place}", message) for place, message in found]


def _tree(draft: Draft) -> Tree:
    def by_id(placed: Sequence[Placed[_E]]) -> dict[str, _E]:
        return {one.entity.id: one.entity for one in placed}

    return Tree(
        by_id(draft.areas), by_id(draft.components), by_id(draft.apps), by_id(draft.functions)
    )
