"""Merging again, where only something has changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import compress
from operator import is_not
from typing import Any, cast

from beacon_gateway.tree.entities import Entity, Tree
from beacon_gateway.tree.merge import (
    KINDS,
    Conflict,
    Layer,
    MergeResult,
    entities_of,
    fold,
    said_of,
)

__all__ = ["IncrementalMerge"]


class IncrementalMerge:
    """Keeps the last result, and folds again only entities that changed in any layer.

    An entity has changed if it is another object: values are immutable, so whoever leaves one alone
    hands in the same. Gives the same as :func:`~.merge.merge`, but for the order of entities: what
    is new comes last. A tree that was handed out stays as it is.

    Thread rule: none of its own; one call at a time.
    """

    def __init__(
        self,
        *,
        strict_upstream: bool = False,
        finish: Callable[[Entity], Entity] | None = None,
    ) -> None:
        """``finish`` is applied to each entity once it is folded; a pure function."""
        self._finish = finish
        self._strict_upstream = strict_upstream
        self._layers: tuple[Layer, ...] = ()
        self._tree = Tree()
        self._conflicts: dict[str, dict[str, tuple[Conflict, ...]]] = {kind: {} for kind in KINDS}
        self._enriched: dict[str, set[str]] = {kind: set() for kind in KINDS}

    def merge(self, layers: Sequence[Layer]) -> MergeResult:
        """All layers together, as they are now.

        The same ``tree`` as last time if nothing has changed.
        """
        old, self._layers = self._layers, tuple(layers)
        another = list(map(_rank, old)) != list(map(_rank, layers))
        kinds: dict[str, Mapping[str, Entity]] = {}
        for kind in KINDS:
            before = [entities_of(layer, kind) for layer in old]
            now = [entities_of(layer, kind) for layer in layers]
            touched = _all(before, now) if another else _changed(before, now)
            if touched:
                kinds[kind] = self._folded(kind, touched)
        if kinds:
            unchanged = {kind: getattr(self._tree, kind) for kind in KINDS if kind not in kinds}
            self._tree = Tree(**cast("Any", {**unchanged, **kinds}))
        return self._result()

    def _folded(self, kind: str, touched: Iterable[str]) -> Mapping[str, Entity]:
        merged: dict[str, Entity] = dict(getattr(self._tree, kind))
        conflicts, enriched = self._conflicts[kind], self._enriched[kind]
        for entity_id in touched:
            conflicts.pop(entity_id, None)
            enriched.discard(entity_id)
            said = said_of(self._layers, kind, entity_id)
            if not said:
                merged.pop(entity_id, None)
                continue
            entity, found = fold(said, strict_upstream=self._strict_upstream)
            merged[entity_id] = entity if self._finish is None else self._finish(entity)
            if found:
                conflicts[entity_id] = found
            if len(said) > 1:
                enriched.add(entity_id)
        return merged

    def _result(self) -> MergeResult:
        by_id = (found for kind in KINDS for found in self._conflicts[kind].values())
        conflicts = tuple(conflict for found in by_id for conflict in found)
        return MergeResult(self._tree, conflicts, sum(map(len, self._enriched.values())))


def _rank(layer: Layer) -> tuple[object, ...]:
    """All about a layer but what it says."""
    return layer.name, layer.policies, layer.unites_lists


def _all(before: Iterable[Iterable[str]], now: Iterable[Iterable[str]]) -> dict[str, None]:
    return {entity_id: None for ids in (*now, *before) for entity_id in ids}


def _changed(
    before: Sequence[Mapping[str, Entity]], now: Sequence[Mapping[str, Entity]]
) -> dict[str, None]:
    pairs = zip(before, now, strict=True)
    return {entity_id: None for old, new in pairs for entity_id in _difference(old, new)}


def _difference(old: Mapping[str, Entity], new: Mapping[str, Entity]) -> Iterable[str]:
    if old is new:
        return ()
    if len(old) == len(new) and not any(map(is_not, old, new)):
        # The usual case, without a look-up for each: the same ids in the same order.
        return compress(new, map(is_not, new.values(), old.values()))
    given = [one for one in new if old.get(one) is not new[one]]
    return [*given, *(one for one in old if one not in new)]
