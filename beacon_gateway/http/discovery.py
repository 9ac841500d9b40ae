"""Who there is: the collections, and each entity in detail."""

from __future__ import annotations

from starlette.routing import BaseRoute

from beacon_gateway.gateway import Gateway
from beacon_gateway.http.app_lines import AppLines
from beacon_gateway.http.details import Details
from beacon_gateway.http.items import Items
from beacon_gateway.http.lookup import named
from beacon_gateway.http.models.discovery import (
    AppDetail,
    AppList,
    AreaDetail,
    AreaList,
    ComponentDetail,
    ComponentList,
    FunctionDetail,
    FunctionList,
)
from beacon_gateway.http.models.medkit import XMedkitCollection
from beacon_gateway.http.operations import Asked, Operation, route
from beacon_gateway.http.snapshots import Snapshots
from beacon_gateway.tree.entities import App, Area, Component, Function

__all__ = ["routes"]


def routes(gateway: Gateway, kept: Snapshots) -> list[BaseRoute]:
    """Lists are made in threads: one of ten thousand keeps nobody waiting."""
    lists = [
        ("listApps", "/apps", "All apps", AppList, AppLines().listing),
        (
            "listComponents",
            "/components",
            "The components that are part of no other",
            ComponentList,
            _components,
        ),
        ("listAreas", "/areas", "The areas that are part of no other", AreaList, _areas),
        ("listFunctions", "/functions", "All functions", FunctionList, _functions),
    ]
    details = [
        ("getApp", "/apps/{app_id}", "One app", AppDetail, _app),
        (
            "getComponent",
            "/components/{component_id}",
            "One component",
            ComponentDetail,
            _component,
        ),
        ("getArea", "/areas/{area_id}", "One area", AreaDetail, _area),
        ("getFunction", "/functions/{function_id}", "One function", FunctionDetail, _function),
    ]
    return [
        route(
            gateway,
            Operation(id=name, tag="Discovery", path=path, summary=summary, body=body),
            handler,
            kept=kept,
            in_thread=in_thread,
        )
        for family, in_thread in ((lists, True), (details, False))
        for name, path, summary, body, handler in family
    ]


def _components(asked: Asked) -> ComponentList:
    items = Items.of(asked)
    components = [items.component(one) for one in asked.tree.top_components()]
    return ComponentList(items=components, x_medkit=XMedkitCollection(total_count=len(components)))


def _areas(asked: Asked) -> AreaList:
    items = Items.of(asked)
    areas = [items.area(area) for area in asked.tree.top_areas()]
    return AreaList(items=areas, x_medkit=XMedkitCollection(total_count=len(areas)))


def _functions(asked: Asked) -> FunctionList:
    items = Items.of(asked)
    functions = [items.function(function) for function in asked.tree.functions.values()]
    return FunctionList(items=functions, x_medkit=XMedkitCollection(total_count=len(functions)))


def _app(asked: Asked) -> AppDetail:
    return Details.of(asked).app(named(asked, App))


def _component(asked: Asked) -> ComponentDetail:
    return Details.of(asked).component(named(asked, Component))


def _area(asked: Asked) -> AreaDetail:
    return Details.of(asked).area(named(asked, Area))


def _function(asked: Asked) -> FunctionDetail:
    return Details.of(asked).function(named(asked, Function))
