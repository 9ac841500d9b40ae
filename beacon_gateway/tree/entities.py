"""The tree that the gateway serves: areas, components, apps and functions, and how they relate.

The core knows as much of the tree as hints are mapped onto (:mod:`beacon_core.entities`). These
classes have what clients of the standard (SOVD) are shown besides.
"""

from __future__ import annotations

import enum
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Protocol, TypeAlias, TypeVar

import attrs

__all__ = [
    "App",
    "Area",
    "Component",
    "Entity",
    "Function",
    "Kind",
    "RosBinding",
    "Tree",
]

_NOTHING: Mapping[str, str] = MappingProxyType({})


class Kind(enum.Enum):
    """What an id may stand for, in the order in which it is looked up."""

    COMPONENT = "Component"
    APP = "App"
    AREA = "Area"
    FUNCTION = "Function"


@attrs.frozen
class Area:
    """A part of the machine or of the plant."""

    id: str
    name: str = ""
    namespace: str = ""
    """The ROS namespace of what is in it, such as ``/powertrain``."""
    parent_area_id: str = ""
    description: str = ""
    tags: tuple[str, ...] = ()
    translation_id: str = ""
    source: str = "manifest"
    """Who told of it first."""


@attrs.frozen
class Component:
    """A computer, a controller or a device."""

    id: str
    name: str = ""
    type: str = ""
    area: str = ""
    """The id of the area it is in."""
    namespace: str = ""
    fqn: str = ""
    """Its full name in ROS."""
    parent_component_id: str = ""
    depends_on: tuple[str, ...] = ()
    variant: str = ""
    identity: Mapping[str, str] = _NOTHING
    """Of the device: manufacturer, serial number and the like, as the manifest has them."""
    external: bool | None = None
    """It is no part of the ROS system; ``None``: nobody said."""
    description: str = ""
    tags: tuple[str, ...] = ()
    translation_id: str = ""
    source: str = "manifest"


@attrs.frozen
class RosBinding:
    """How a node of the ROS graph is recognised as an app."""

    node_name: str = ""
    namespace: str = ""
    """``""`` means ``/``; ``*`` any; otherwise a prefix of whole segments."""
    topic_namespace: str = ""


@attrs.frozen
class App:
    """A running piece of software."""

    id: str
    name: str = ""
    component_id: str = ""
    """The component that hosts it."""
    depends_on: tuple[str, ...] = ()
    ros_binding: RosBinding | None = None
    bound_fqn: str = ""
    """The full name of the ROS node that it is; empty while none is there."""
    is_online: bool = False
    """As the ROS graph has it; a beacon says so beside."""
    external: bool | None = None
    description: str = ""
    tags: tuple[str, ...] = ()
    translation_id: str = ""
    source: str = "manifest"


@attrs.frozen
class Function:
    """Something the machine can do, and who takes part in it."""

    id: str
    name: str = ""
    hosts: tuple[str, ...] = ()
    """The ids of apps and components that take part, known or not."""
    depends_on: tuple[str, ...] = ()
    description: str = ""
    tags: tuple[str, ...] = ()
    translation_id: str = ""
    source: str = "manifest"


Entity: TypeAlias = Area | Component | App | Function
"""Any of the four."""


class _HasId(Protocol):
    @property
    def id(self) -> str: ...


_E = TypeVar("_E", bound=_HasId)


@attrs.frozen(slots=False)
class Tree:
    """All entities at one moment, each kind by id in a stable order.

    Immutable, so any thread may read it; a changed tree is another object. The relations are
    worked out when they are first asked for.
    """

    areas: Mapping[str, Area] = attrs.field(factory=dict)
    components: Mapping[str, Component] = attrs.field(factory=dict)
    apps: Mapping[str, App] = attrs.field(factory=dict)
    functions: Mapping[str, Function] = attrs.field(factory=dict)

    def kind(self, entity_id: str) -> Kind | None:
        """What the id stands for, ``None`` if it is unknown."""
        if entity_id in self.components:
            return Kind.COMPONENT
        if entity_id in self.apps:
            return Kind.APP
        if entity_id in self.areas:
            return Kind.AREA
        return Kind.FUNCTION if entity_id in self.functions else None

    def top_areas(self) -> Iterable[Area]:
        """Those that are part of no other."""
        return self._subareas[""]

    def subareas(self, area_id: str) -> Iterable[Area]:
        """Those directly within it."""
        return self._subareas.get(area_id, ())

    def components_in(self, area_id: str) -> Iterable[Component]:
        """The components of exactly this area."""
        return self._components_in.get(area_id, ())

    def contained_in(self, area_id: str) -> Iterable[Component]:
        """The components of this area and of all areas within it."""
        seen: set[str] = set()
        waiting = [area_id]
        while waiting:
            here = waiting.pop(0)
            if here in seen:
                continue
            seen.add(here)
            yield from self.components_in(here)
            waiting += [area.id for area in self.subareas(here)]

    def top_components(self) -> Iterable[Component]:
        """Those that are part of no other."""
        return self._subcomponents[""]

    def subcomponents(self, component_id: str) -> Iterable[Component]:
        """Those directly part of it."""
        return self._subcomponents.get(component_id, ())

    def apps_on(self, component_id: str) -> Iterable[App]:
        """The apps it hosts."""
        return self._apps_on.get(component_id, ())

    @cached_property
    def _subareas(self) -> Mapping[str, list[Area]]:
        return _grouped(self.areas.values(), lambda area: area.parent_area_id)

    @cached_property
    def _components_in(self) -> Mapping[str, list[Component]]:
        return _grouped(self.components.values(), lambda component: component.area)

    @cached_property
    def _subcomponents(self) -> Mapping[str, list[Component]]:
        return _grouped(self.components.values(), lambda one: one.parent_component_id)

    @cached_property
    def _apps_on(self) -> Mapping[str, list[App]]:
        return _grouped(self.apps.values(), lambda app: app.component_id)


def _grouped(entities: Iterable[_E], key: Callable[[_E], str]) -> Mapping[str, list[_E]]:
    groups: dict[str, list[_E]] = defaultdict(list, {"": []})
    for entity in entities:
        groups[key(entity)].append(entity)
    return dict(groups)
