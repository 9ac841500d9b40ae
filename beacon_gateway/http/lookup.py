"""Whom a path names: three ways to look it up, each with its own refusals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar, cast

from beacon_gateway.http import errors
from beacon_gateway.http.operations import Asked
from beacon_gateway.tree.entities import App, Area, Component, Entity, Function, Kind, Tree

__all__ = ["COLLECTIONS", "entities", "named", "owner", "vendors"]

_E = TypeVar("_E", bound=Entity)

COLLECTIONS: Mapping[type[object], str] = {
    Area: "areas",
    Component: "components",
    App: "apps",
    Function: "functions",
}
"""The path segment of each kind of entity, which is also its field of a tree."""


def entities(tree: Tree, cls: type[_E]) -> Mapping[str, _E]:
    """All of one kind, by id."""
    return cast("Mapping[str, _E]", getattr(tree, COLLECTIONS[cls]))


def named(asked: Asked, cls: type[_E]) -> _E:
    """The entity that the path names, as most routes look for it."""
    errors.check_id(asked.id)
    entity = entities(asked.tree, cls).get(asked.id)
    if entity is not None:
        return entity
    actual = asked.tree.kind(asked.id)
    if actual is None:
        raise errors.entity_not_found(asked.id)
    raise errors.wrong_type(asked.id, Kind(cls.__name__), actual)


def owner(asked: Asked, cls: type[_E]) -> _E:
    """The entity that the path names, as lists of what belongs to it look for it."""
    errors.check_owner_id(asked.id, Kind(cls.__name__))
    entity = entities(asked.tree, cls).get(asked.id)
    if entity is None:
        raise errors.owner_not_found(asked.id, Kind(cls.__name__))
    return entity


def vendors(asked: Asked, cls: type[_E]) -> _E:
    """The entity that the path names, as vendor endpoints look for it."""
    errors.check_vendor_id(asked.id)
    entity = entities(asked.tree, cls).get(asked.id)
    if entity is None:
        raise errors.vendor_entity_missing(asked.id, Kind(cls.__name__), asked.tree.kind(asked.id))
    return entity
