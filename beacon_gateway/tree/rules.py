"""What a manifest must not say, by ros2_medkit's codes."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from typing import Generic, TypeVar

import attrs

from beacon_gateway.tree.entities import App, Area, Component, Entity, Function

__all__ = ["Draft", "Finding", "Placed", "errors", "warnings"]

_E_co = TypeVar("_E_co", bound=Entity, covariant=True)

Finding = tuple[str, str]
"""A place such as ``.apps[2].id``, and what is wrong there."""


@attrs.frozen
class Placed(Generic[_E_co]):
    """An entity, and where it stands in the document."""

    at: str
    entity: _E_co


@attrs.frozen
class Draft:
    """A manifest that has been read but not yet checked."""

    areas: Sequence[Placed[Area]] = ()
    components: Sequence[Placed[Component]] = ()
    apps: Sequence[Placed[App]] = ()
    functions: Sequence[Placed[Function]] = ()
    unreadable: frozenset[str] = frozenset()
    """Ids of entries that something else is wrong with: who names them is not to blame."""


def errors(draft: Draft) -> Iterator[Finding]:
    """What makes a manifest unusable."""
    yield from _doubles(draft)
    yield from _lost_parents(draft)
    yield from _lost_hosts(draft)
    yield from _double_bindings(draft)
    yield from _cycles(draft)


def warnings(draft: Draft) -> Iterator[Finding]:
    """What may be meant so."""
    known = {one.entity.id for one in _all(draft)} | draft.unreadable
    needy: list[Placed[Component] | Placed[App] | Placed[Function]]
    needy = [*draft.components, *draft.apps, *draft.functions]
    for one in needy:
        yield from _unknown(one, "depends_on", one.entity.depends_on, known, "R008")
    for function in draft.functions:
        yield from _unknown(function, "hosted_by", function.entity.hosts, known, "R009")
    for app in draft.apps:
        binding = app.entity.ros_binding
        if binding is None:
            continue
        if app.entity.external:
            yield f"{app.at}.ros_binding", "R013: an external app is no node; it is not bound"
        if not binding.node_name:
            yield f"{app.at}.ros_binding", "only node_name binds; without it, the app has no node"


def _all(draft: Draft) -> Iterable[Placed[Entity]]:
    return (*draft.areas, *draft.components, *draft.apps, *draft.functions)


def _doubles(draft: Draft) -> Iterator[Finding]:
    # An id stands for one thing, whatever its kind: entities are asked for by it.
    first: dict[str, str] = {}
    kinds = {Area: "R002", Component: "R003", App: "R004", Function: "R005"}
    for one in _all(draft):
        entity_id = one.entity.id
        if entity_id in first:
            code = kinds[type(one.entity)]
            yield f"{one.at}.id", f"{code}: {entity_id} is already the id of ${first[entity_id]}"
        first.setdefault(entity_id, one.at)


def _lost_parents(draft: Draft) -> Iterator[Finding]:
    areas = {one.entity.id for one in draft.areas} | draft.unreadable
    components = {one.entity.id for one in draft.components} | draft.unreadable
    for area in draft.areas:
        yield from _missing(area, "parent_area", area.entity.parent_area_id, areas, "R006: area")
    for one in draft.components:
        parent = one.entity.parent_component_id
        yield from _missing(one, "area", one.entity.area, areas, "R006: area")
        yield from _missing(one, "parent_component_id", parent, components, "R006: component")


def _lost_hosts(draft: Draft) -> Iterator[Finding]:
    known = {one.entity.id for one in draft.components} | draft.unreadable
    for app in draft.apps:
        host = app.entity.component_id
        yield from _missing(app, "is_located_on", host, known, "R007: component")


def _missing(
    one: Placed[Entity], key: str, named: str, known: Container[str], what: str
) -> Iterator[Finding]:
    if named and named not in known:
        yield f"{one.at}.{key}", f"{what} {named} is not in this manifest"


def _unknown(
    one: Placed[Entity], key: str, named: Iterable[str], known: Container[str], code: str
) -> Iterator[Finding]:
    for index, entity_id in enumerate(named):
        if entity_id not in known:
            yield f"{one.at}.{key}[{index}]", f"{code}: {entity_id} is not in this manifest"


def _double_bindings(draft: Draft) -> Iterator[Finding]:
    first: dict[tuple[str, ...], str] = {}
    for app in draft.apps:
        binding = app.entity.ros_binding
        if binding is None or not (binding.node_name or binding.topic_namespace):
            continue
        key: tuple[str, ...] = (binding.node_name, binding.namespace.rstrip("/"))
        if binding.topic_namespace:
            key = (binding.topic_namespace,)
        if key in first and "*" not in key:
            yield f"{app.at}.ros_binding", f"R010: the same as that of {first[key]}"
        first.setdefault(key, app.entity.id)


def _cycles(draft: Draft) -> Iterator[Finding]:
    yield from _cycle(draft.areas, "parent_area", lambda one: (one.parent_area_id,))
    yield from _cycle(
        draft.components, "parent_component_id", lambda one: (one.parent_component_id,)
    )
    yield from _cycle(draft.apps, "depends_on", lambda one: one.depends_on)
    yield from _cycle(draft.functions, "depends_on", lambda one: one.depends_on)


_E = TypeVar("_E", bound=Entity)


def _cycle(
    placed: Iterable[Placed[_E]], key: str, leads_to: Callable[[_E], Iterable[str]]
) -> Iterator[Finding]:
    """Each knot is reported once, at the first of its entities that is met."""
    graph = {one.entity.id: tuple(leads_to(one.entity)) for one in placed}
    where = {one.entity.id: one.at for one in placed}
    done: set[str] = set()
    for start in graph:
        found = _first_cycle(start, graph, done)
        if found:
            yield f"{where[found[0]]}.{key}", f"R011: a cycle: {' -> '.join(found)}"


def _first_cycle(start: str, graph: Mapping[str, Sequence[str]], done: set[str]) -> list[str]:
    """A cycle that can be reached from ``start`` through nobody in ``done``; those met are."""
    found: list[str] = []
    way: dict[str, Iterator[str]] = {}
    if start not in done:
        way[start] = iter(graph[start])
    while way:
        here = next(reversed(way))
        following = next(way[here], None)
        if following is None:
            done.add(here)
            way.popitem()
        elif following in way and not found:
            ids = list(way)
            found = [*ids[ids.index(following) :], following]
        elif following in graph and following not in done and following not in way:
            way[following] = iter(graph[following])
    return found
