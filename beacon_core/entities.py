"""The tree of entities a gateway knows, as far as hints are mapped onto it.

The same four classes serve as *shadows*: what a hint says about an entity, to be laid over the
known one of that id. In a shadow an empty field means "the hint does not say".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Protocol, TypeAlias, TypeVar

import attrs

__all__ = ["App", "Area", "Component", "Entities", "Function"]


@attrs.frozen
class Area:
    """A part of the machine or of the plant."""

    id: str
    name: str = ""


@attrs.frozen
class Component:
    """A computer, a controller or a device."""

    id: str
    name: str = ""
    source: str = "node"
    """Who told of it: ``manifest``, or the runtime's ``node``."""


@attrs.frozen
class App:
    """A running piece of software."""

    id: str
    name: str = ""
    component_id: str = ""
    """The component that hosts it."""
    source: str = "manifest"
    """Who told of it; ``beacon`` if nobody but its own hint did."""


@attrs.frozen
class Function:
    """Something the machine can do, and who takes part in it."""

    id: str
    name: str = ""
    hosts: tuple[str, ...] = ()
    """The ids of apps and components that take part. A shadow lists only those that join."""
    source: str = "manifest"


class _HasId(Protocol):
    @property
    def id(self) -> str: ...


_E = TypeVar("_E", bound=_HasId)
_Given: TypeAlias = Iterable[_E] | Mapping[str, _E]


@attrs.frozen(init=False)
class Entities:
    """The known tree at one moment: each kind by id, in the order given.

    Made from any iterables of entities (or from mappings by id, so that ``attrs.evolve`` works);
    of several with one id the first one counts. Immutable, so whoever has seen this object has
    seen all it will ever say: a changed tree is another object.
    """

    areas: Mapping[str, Area]
    components: Mapping[str, Component]
    apps: Mapping[str, App]
    functions: Mapping[str, Function]

    def __init__(
        self,
        areas: _Given[Area] = (),
        components: _Given[Component] = (),
        apps: _Given[App] = (),
        functions: _Given[Function] = (),
    ) -> None:
        self.__attrs_init__(_by_id(areas), _by_id(components), _by_id(apps), _by_id(functions))


def _by_id(given: _Given[_E]) -> Mapping[str, _E]:
    found: dict[str, _E] = {}
    for entity in given.values() if isinstance(given, Mapping) else given:
        found.setdefault(entity.id, entity)
    return MappingProxyType(found)
