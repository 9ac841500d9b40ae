"""Collections of entities, and each of them in detail."""

from __future__ import annotations

import enum
from collections.abc import Sequence

import attrs

from beacon_gateway.http.models.base import Open, key, optional_key
from beacon_gateway.http.models.medkit import (
    XMedkitApp,
    XMedkitArea,
    XMedkitCollection,
    XMedkitComponent,
    XMedkitFunction,
)

__all__ = [
    "AppDetail",
    "AppList",
    "AppListItem",
    "AreaDetail",
    "AreaList",
    "AreaListItem",
    "ComponentDetail",
    "ComponentList",
    "ComponentListItem",
    "EntityType",
    "FunctionDetail",
    "FunctionList",
    "FunctionListItem",
    "Listing",
]


class EntityType(enum.StrEnum):
    """What an entity is."""

    AREA = "area"
    COMPONENT = "component"
    APP = "app"
    FUNCTION = "function"


@attrs.frozen(kw_only=True)
class _Item:
    """One line of a collection."""

    id: str
    name: str
    href: str
    type: EntityType
    description: str | None = None
    tags: Sequence[str] | None = None


@attrs.frozen(kw_only=True)
class AreaListItem(_Item):
    """An area as a list tells of it."""

    x_medkit: XMedkitArea | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class ComponentListItem(_Item):
    """A component as a list tells of it."""

    x_medkit: XMedkitComponent | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class AppListItem(_Item):
    """An app as a list tells of it."""

    x_medkit: XMedkitApp | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class FunctionListItem(_Item):
    """A function as a list tells of it."""

    x_medkit: XMedkitFunction | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class Listing:
    """What every collection has besides its items."""

    x_medkit: XMedkitCollection | None = optional_key("x-medkit")
    links: Open | None = optional_key("_links")


@attrs.frozen(kw_only=True)
class AreaList(Listing):
    """Some areas, in no order that can be relied on."""

    items: Sequence[AreaListItem]


@attrs.frozen(kw_only=True)
class ComponentList(Listing):
    """Some components, in no order that can be relied on."""

    items: Sequence[ComponentListItem]


@attrs.frozen(kw_only=True)
class AppList(Listing):
    """Some apps, in no order that can be relied on."""

    items: Sequence[AppListItem]


@attrs.frozen(kw_only=True)
class FunctionList(Listing):
    """Some functions, in no order that can be relied on."""

    items: Sequence[FunctionListItem]


@attrs.frozen(kw_only=True)
class _Detail:
    """Every address is given, whether or not something answers there."""

    id: str
    name: str
    type: EntityType
    data: str
    operations: str
    configurations: str
    faults: str
    logs: str
    bulk_data: str = key("bulk-data")
    triggers: str
    description: str | None = None
    tags: Sequence[str] | None = None
    capabilities: object | None = None
    links: Open | None = optional_key("_links")


@attrs.frozen(kw_only=True)
class AreaDetail(_Detail):
    """One area, with the addresses of what is within it."""

    subareas: str
    components: str
    contains: str
    x_medkit: XMedkitArea | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class ComponentDetail(_Detail):
    """One component, with the addresses of what it is made of, hosts and needs."""

    status: str
    subcomponents: str
    hosts: str
    cyclic_subscriptions: str = key("cyclic-subscriptions")
    scripts: str | None = None
    depends_on: str | None = optional_key("depends-on")
    belongs_to: str | None = optional_key("belongs-to")
    x_medkit: XMedkitComponent | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class AppDetail(_Detail):
    """One app, with the addresses of what hosts it and of what it needs."""

    status: str
    cyclic_subscriptions: str = key("cyclic-subscriptions")
    translation_id: str | None = None
    scripts: str | None = None
    is_located_on: str | None = optional_key("is-located-on")
    belongs_to: str | None = optional_key("belongs-to")
    depends_on: str | None = optional_key("depends-on")
    x_medkit: XMedkitApp | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class FunctionDetail(_Detail):
    """One function, with the addresses of the apps that take part in it."""

    hosts: str
    x_medkit_graph: str = key("x-medkit-graph")
    cyclic_subscriptions: str = key("cyclic-subscriptions")
    translation_id: str | None = None
    x_medkit: XMedkitFunction | None = optional_key("x-medkit")
