"""How entities relate: what an area contains, who is hosted where, who depends on whom."""

from __future__ import annotations

from typing import Any

from starlette.routing import BaseRoute

from beacon_gateway.gateway import Gateway
from beacon_gateway.http.items import Items
from beacon_gateway.http.lookup import COLLECTIONS, named, owner
from beacon_gateway.http.models.base import Open
from beacon_gateway.http.models.discovery import (
    AppList,
    AppListItem,
    AreaList,
    ComponentList,
    ComponentListItem,
)
from beacon_gateway.http.models.medkit import XMedkitCollection
from beacon_gateway.http.operations import Asked, Operation, route
from beacon_gateway.http.snapshots import Snapshots
from beacon_gateway.tree.entities import App, Area, Component, Entity, Function

__all__ = ["routes"]

_AREA, _COMPONENT, _APP = "/areas/{area_id}", "/components/{component_id}", "/apps/{app_id}"


def routes(gateway: Gateway, kept: Snapshots) -> list[BaseRoute]:
    """All lists are made in threads."""
    table = [
        (
            "listAreaComponents",
            f"{_AREA}/components",
            "The components of exactly this area",
            ComponentList,
            _area_components,
        ),
        ("listSubareas", f"{_AREA}/subareas", "The areas directly within it", AreaList, _subareas),
        (
            "listAreaContains",
            f"{_AREA}/contains",
            "The components of this area and all within it",
            ComponentList,
            _contains,
        ),
        (
            "listSubcomponents",
            f"{_COMPONENT}/subcomponents",
            "The components directly part of it",
            ComponentList,
            _subcomponents,
        ),
        (
            "listComponentHosts",
            f"{_COMPONENT}/hosts",
            "The apps it hosts",
            AppList,
            _component_hosts,
        ),
        (
            "listComponentDependencies",
            f"{_COMPONENT}/depends-on",
            "What it depends on",
            ComponentList,
            _component_dependencies,
        ),
        (
            "getAppHost",
            f"{_APP}/is-located-on",
            "The component that hosts it, if any",
            ComponentList,
            _app_host,
        ),
        (
            "getAppArea",
            f"{_APP}/belongs-to",
            "The area of the component that hosts it, if any",
            AreaList,
            _app_area,
        ),
        (
            "listAppDependencies",
            f"{_APP}/depends-on",
            "What it depends on",
            AppList,
            _app_dependencies,
        ),
        (
            "listFunctionHosts",
            "/functions/{function_id}/hosts",
            "The apps that take part in it",
            AppList,
            _function_hosts,
        ),
    ]
    return [
        route(
            gateway,
            Operation(id=name, tag="Discovery", path=path, summary=summary, body=body),
            handler,
            kept=kept,
            in_thread=True,
        )
        for name, path, summary, body, handler in table
    ]


def _area_components(asked: Asked) -> ComponentList:
    area, items = owner(asked, Area), Items.of(asked)
    # Alone of all these lists it has no links there either.
    return _components([items.component(one) for one in asked.tree.components_in(area.id)], None)


def _subareas(asked: Asked) -> AreaList:
    area, items = owner(asked, Area), Items.of(asked)
    links = _links(asked, area, "subareas", "parent")
    return _areas([items.area(one) for one in asked.tree.subareas(area.id)], links)


def _contains(asked: Asked) -> ComponentList:
    area, items = owner(asked, Area), Items.of(asked)
    links = _links(asked, area, "contains", "area")
    return _components([items.component(one) for one in asked.tree.contained_in(area.id)], links)


def _subcomponents(asked: Asked) -> ComponentList:
    component, items = owner(asked, Component), Items.of(asked)
    links = _links(asked, component, "subcomponents", "parent")
    found = asked.tree.subcomponents(component.id)
    return _components([items.component(one) for one in found], links)


def _component_hosts(asked: Asked) -> AppList:
    component, items = owner(asked, Component), Items.of(asked)
    links = _links(asked, component, "hosts", "component")
    return _apps([items.app(app) for app in asked.tree.apps_on(component.id)], links)


def _component_dependencies(asked: Asked) -> ComponentList:
    component, items = owner(asked, Component), Items.of(asked)
    links = _links(asked, component, "depends-on", "component")
    found = [items.needed_by_component(one) for one in component.depends_on]
    return _components(found, links)


def _app_host(asked: Asked) -> ComponentList:
    app, items = named(asked, App), Items.of(asked)
    links = _links(asked, app, "is-located-on", "app")
    if not app.component_id:
        return _components([], links)
    host = asked.tree.components.get(app.component_id)
    missing = items.missing_component(app.component_id)
    return _components([missing if host is None else items.component(host)], links)


def _app_area(asked: Asked) -> AreaList:
    app, items = named(asked, App), Items.of(asked)
    links = _links(asked, app, "belongs-to", "app")
    if not app.component_id:
        return _areas([], links)
    host = asked.tree.components.get(app.component_id)
    if host is None:
        return _areas([items.unknown_area(app.component_id)], links)
    if not host.area:
        return _areas([], links)
    area = asked.tree.areas.get(host.area)
    return _areas([items.missing_area(host.area) if area is None else items.area(area)], links)


def _app_dependencies(asked: Asked) -> AppList:
    app, items = named(asked, App), Items.of(asked)
    links = _links(asked, app, "depends-on", "app")
    return _apps([items.needed_by_app(one) for one in app.depends_on], links)


def _function_hosts(asked: Asked) -> AppList:
    function, items = owner(asked, Function), Items.of(asked)
    links = _links(asked, function, "hosts", "function")
    known = asked.tree.apps
    return _apps([items.app(known[one]) for one in function.hosts if one in known], links)


def _links(asked: Asked, entity: Entity, relation: str, owner_as: str) -> Open:
    href = f"{asked.base}/{COLLECTIONS[type(entity)]}/{entity.id}"
    return {"self": f"{href}/{relation}", owner_as: href}


def _areas(found: list[Any], links: Open | None) -> AreaList:
    return AreaList(items=found, x_medkit=_count(found), links=links)


def _components(found: list[ComponentListItem], links: Open | None) -> ComponentList:
    return ComponentList(items=found, x_medkit=_count(found), links=links)


def _apps(found: list[AppListItem], links: Open | None) -> AppList:
    return AppList(items=found, x_medkit=_count(found), links=links)


def _count(found: list[Any]) -> XMedkitCollection:
    return XMedkitCollection(total_count=len(found))
