"""Layers of the tree into one: a fold, per entity and per group of its fields.

Theory. Each layer says something about some entities; an empty field says nothing. The layers that
know an id are folded from left to right. Of each group of fields (:mod:`.policies`) one layer is
the owner: at first the one that knew the entity first. The next layer's policy for the group is
compared with the owner's:

* it is higher: the newcomer wins, and owns the group from now on;
* it is lower: the owner wins;
* both are AUTHORITATIVE: the owner wins, and the conflict is reported;
* otherwise they are equals: what one has not said the other may, and lists are united.

What winning means for a value is its :class:`~.policies.Rule`. A loser still fills what the winner
has left empty, but for lists and what binds an app to a node.

This is ros2_medkit's fold with two differences, and ``strict_upstream`` takes both back. There a
winner's list replaces, also if it is empty: a beacon that says nothing of tags wipes the tags.
Here an empty list never wipes; and in a layer that only adds (``unites_lists``) a list that wins is
united with what was there. And there the hosts of a manifest's function are final.
"""

from __future__ import annotations

import enum
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain
from typing import Any, TypeAlias, TypeVar, cast

import attrs

from beacon_gateway.tree.entities import Entity, Tree
from beacon_gateway.tree.policies import (
    FIELDS,
    UPSTREAM_FIELDS,
    Field,
    Group,
    Policies,
    Policy,
    Rule,
)

__all__ = [
    "KINDS",
    "Conflict",
    "Layer",
    "MergeResult",
    "Said",
    "entities_of",
    "fold",
    "merge",
    "said_of",
]

KINDS = ("areas", "components", "apps", "functions")
"""The four mappings of a tree."""

_E = TypeVar("_E", bound=Entity)


@attrs.frozen
class Layer:
    """What one of those who know says about entities."""

    name: str
    tree: Tree
    policies: Policies
    unites_lists: bool = False
    """Its lists are additions."""
    touched: Mapping[str, Collection[str]] | None = None
    """By kind, of whom it may say another thing than the last time; ``None``: compare all. It is
    for merging again, and what is merged does not depend on it."""


@attrs.frozen
class Conflict:
    """Two layers claim the last word on one group of an entity's fields."""

    entity_id: str
    field_group: Group
    winning_layer: str
    losing_layer: str


@attrs.frozen
class MergeResult:
    """All layers together."""

    tree: Tree
    conflicts: tuple[Conflict, ...] = ()
    enriched: int = 0
    """How many entities more than one layer knows."""


Said: TypeAlias = Sequence[tuple[Layer, _E]]
"""What the layers that know an entity say about it, in order."""


def merge(layers: Sequence[Layer], *, strict_upstream: bool = False) -> MergeResult:
    """Merge from scratch. Pure; the cost is linear in what the layers say."""
    conflicts: list[Conflict] = []
    enriched = 0
    kinds: dict[str, Mapping[str, Entity]] = {}
    for kind in KINDS:
        merged: dict[str, Entity] = {}
        for entity_id in dict.fromkeys(chain(*(entities_of(one, kind) for one in layers))):
            said = said_of(layers, kind, entity_id)
            merged[entity_id], found = fold(said, strict_upstream=strict_upstream)
            conflicts += found
            enriched += len(said) > 1
        kinds[kind] = merged
    return MergeResult(Tree(**cast("Any", kinds)), tuple(conflicts), enriched)


def entities_of(layer: Layer, kind: str) -> Mapping[str, Entity]:
    """The layer's entities of one of ``KINDS``, by id."""
    return cast("Mapping[str, Entity]", getattr(layer.tree, kind))


def said_of(layers: Iterable[Layer], kind: str, entity_id: str) -> list[tuple[Layer, Entity]]:
    """What each layer that knows the entity says about it."""
    found = []
    for layer in layers:
        entity = entities_of(layer, kind).get(entity_id)
        if entity is not None:
            found.append((layer, entity))
    return found


def fold(said: Said[_E], *, strict_upstream: bool = False) -> tuple[_E, tuple[Conflict, ...]]:
    """One entity as all layers together have it, and what they quarrel over.

    ``said`` is not empty, and of one kind and id.
    """
    owner, first = said[0]
    if len(said) == 1:
        return first, ()
    fields = _fields_of(type(first), strict_upstream)
    values = {field.name: getattr(first, field.name) for field in fields}
    owners = dict.fromkeys((field.group for field in fields), owner)
    conflicts: list[Conflict] = []
    for layer, entity in said[1:]:
        winners = {group: _winner(owners[group], layer, group) for group in owners}
        unites = layer.unites_lists and not strict_upstream
        for field in fields:
            value = getattr(entity, field.name)
            # Nothing said changes nothing; but "false" is said.
            if value or value is False or strict_upstream:
                winner = winners[field.group]
                values[field.name] = _merged(field, values[field.name], value, winner, unites)
        for group, winner in winners.items():
            if winner is _Winner.NEWCOMER:
                owners[group] = layer
            elif owners[group].policies[group] is layer.policies[group] is Policy.AUTHORITATIVE:
                conflicts.append(Conflict(first.id, group, owners[group].name, layer.name))
    return type(first)(id=first.id, **values), tuple(conflicts)


def _fields_of(kind: type[Any], strict_upstream: bool) -> tuple[Field, ...]:  # noqa: FBT001
    return (UPSTREAM_FIELDS if strict_upstream else FIELDS)[kind]


class _Winner(enum.Enum):
    OWNER = enum.auto()
    NEWCOMER = enum.auto()
    BOTH = enum.auto()


def _winner(owner: Layer, layer: Layer, group: Group) -> _Winner:
    ours, theirs = owner.policies[group], layer.policies[group]
    if theirs > ours:
        return _Winner.NEWCOMER
    if theirs < ours or ours is Policy.AUTHORITATIVE:
        return _Winner.OWNER
    return _Winner.BOTH


def _merged(field: Field, old: Any, new: Any, winner: _Winner, unites: bool) -> Any:  # noqa: FBT001 - as the caller has it, per field
    rule = field.rule
    if rule is Rule.LIST:
        if winner is _Winner.BOTH or (unites and winner is _Winner.NEWCOMER):
            return tuple(dict.fromkeys((*old, *new)))
        return new if winner is _Winner.NEWCOMER else old
    if rule is Rule.FLAG:
        return new if winner is _Winner.NEWCOMER else old or (new and winner is _Winner.BOTH)
    if rule is Rule.MAPPING:
        return {**old, **new} if winner is _Winner.NEWCOMER else {**new, **old}
    if _said(new) and winner is _Winner.NEWCOMER and rule is not Rule.FIRST:
        return new
    may_fill = rule is not Rule.GIVEN or winner is not _Winner.OWNER
    return new if may_fill and not _said(old) else old


def _said(value: Any) -> bool:
    # "external: false" is a statement.
    return value is not None and value != ""
