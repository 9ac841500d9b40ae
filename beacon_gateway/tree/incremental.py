"""Merging again, where only something has changed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
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
    hands in the same. All are compared, unless a layer says itself who that can be
    (:attr:`~.merge.Layer.touched`). Gives the same as :func:`~.merge.merge`, but for the order of
    entities: what is new comes last. A tree that was handed out stays as it is.

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
        self.folded: Mapping[str, Collection[str]] = {}
        """By kind, who was folded by the last ``merge``: nobody else has changed in it."""

    def merge(self, layers: Sequence[Layer]) -> MergeResult:
        """All layers together, as they are now.

        The same ``tree`` as last time if no entity has changed by it.
        """
        old, self._layers = self._layers, tuple(layers)
        another = list(map(_rank, old)) != list(map(_rank, layers))
        kinds: dict[str, Mapping[str, Entity]] = {}
        self.folded = {
            kind: _all(kind, old, layers) if another else _changed(kind, old, layers)
            for kind in KINDS
        }
        for kind, touched in self.folded.items():
            kept = getattr(self._tree, kind)
            kinds[kind] = self._folded(kind, touched) if touched else kept
        if any(kinds[kind] is not getattr(self._tree, kind) for kind in KINDS):
            self._tree = Tree(**cast("Any", kinds))
        return self._result()

    def _folded(self, kind: str, touched: Iterable[str]) -> Mapping[str, Entity]:
        """The entities of a kind as they are now; the same object if all are as they were."""
        before: Mapping[str, Entity] = getattr(self._tree, kind)
        merged = dict(before)
        changed = False
        for entity_id in touched:
            entity = self._fold(kind, entity_id)
            if entity == merged.get(entity_id):
                continue
            changed = True
            if entity is None:
                del merged[entity_id]
            else:
                merged[entity_id] = entity
        return merged if changed else before

    def _fold(self, kind: str, entity_id: str) -> Entity | None:
        """One entity as it is now; ``None`` if nobody knows it any more."""
        self._conflicts[kind].pop(entity_id, None)
        self._enriched[kind].discard(entity_id)
        said = said_of(self._layers, kind, entity_id)
        if not said:
            return None
        entity, found = fold(said, strict_upstream=self._strict_upstream)
        if found:
            self._conflicts[kind][entity_id] = found
        if len(said) > 1:
            self._enriched[kind].add(entity_id)
        return entity if self._finish is None else self._finish(entity)

    def _result(self) -> MergeResult:
        by_id = (found for kind in KINDS for found in self._conflicts[kind].values())
        conflicts = tuple(conflict for found in by_id for conflict in found)
        return MergeResult(self._tree, conflicts, sum(map(len, self._enriched.values())))


def _rank(layer: Layer) -> tuple[object, ...]:
    """All about a layer but what it says."""
    return layer.name, layer.policies, layer.unites_lists


def _all(kind: str, *times: Iterable[Layer]) -> dict[str, None]:
    layers = [layer for layers in times for layer in layers]
    return {entity_id: None for layer in layers for entity_id in entities_of(layer, kind)}


def _changed(kind: str, before: Sequence[Layer], now: Sequence[Layer]) -> dict[str, None]:
    changed: dict[str, None] = {}
    for then, layer in zip(before, now, strict=True):
        old, new = entities_of(then, kind), entities_of(layer, kind)
        if old is not new:
            known = layer.touched
            found = _difference(old, new) if known is None else known.get(kind, ())
            changed.update(dict.fromkeys(found))
    return changed


def _difference(old: Mapping[str, Entity], new: Mapping[str, Entity]) -> Iterable[str]:
    if len(old) == len(new) and not any(map(is_not, old, new)):
        # The usual case, without a look-up for each: the same ids in the same order.
        return compress(new, map(is_not, new.values(), old.values()))
    given = [one for one in new if old.get(one) is not new[one]]
    return [*given, *(one for one in old if one not in new)]
