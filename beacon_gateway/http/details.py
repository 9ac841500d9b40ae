"""One entity in detail: its addresses, what it can be asked, and how it is linked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import attrs

from beacon_gateway.http.blocks import Blocks
from beacon_gateway.http.items import common
from beacon_gateway.http.lookup import COLLECTIONS
from beacon_gateway.http.models.base import Open, key_of
from beacon_gateway.http.models.discovery import (
    AppDetail,
    AreaDetail,
    ComponentDetail,
    FunctionDetail,
)
from beacon_gateway.http.models.medkit import XMedkitArea
from beacon_gateway.http.operations import Asked
from beacon_gateway.tree.entities import App, Area, Component, Entity, Function
from beacon_gateway.vendor import BEACON

__all__ = ["Details"]

_Detail = AreaDetail | ComponentDetail | AppDetail | FunctionDetail

_RESOURCES = "data operations configurations faults logs"
_CAPABILITIES: Mapping[type[Entity], Sequence[str]] = {
    Area: f"subareas contains {_RESOURCES} bulk-data triggers".split(),
    Component: (
        f"status {_RESOURCES} subcomponents hosts bulk-data cyclic-subscriptions triggers".split()
    ),
    App: f"status {_RESOURCES} bulk-data cyclic-subscriptions triggers".split(),
    Function: f"hosts {_RESOURCES} bulk-data cyclic-subscriptions triggers".split(),
}
"""What every entity of a kind can be asked, in the order clients show it."""


@attrs.frozen
class Details:
    """Makes the detail of one entity."""

    base: str
    blocks: Blocks

    @classmethod
    def of(cls, asked: Asked) -> Details:
        return cls(asked.base, Blocks(asked.gateway, asked.tree))

    def area(self, area: Area) -> AreaDetail:
        block = attrs.evolve(
            self.blocks.area(area) or XMedkitArea(), parent_area_id=area.parent_area_id or None
        )
        parent = {"parent": self._at("areas", area.parent_area_id)} if area.parent_area_id else {}
        return AreaDetail(
            **self._head(area, AreaDetail),
            capabilities=self._capabilities(area),
            links=self._links(area, parent),
            x_medkit=block if block != XMedkitArea() else None,
        )

    def component(self, component: Component) -> ComponentDetail:
        depends = ["depends-on"] if component.depends_on else []
        capabilities = self._capabilities(component, depends, self._vendors())
        links: dict[str, object] = {}
        if component.parent_component_id:
            links["parent"] = self._at("components", component.parent_component_id)
        area = self._at("areas", component.area) if component.area else None
        if area:
            links["area"] = area
        return ComponentDetail(
            **self._head(component, ComponentDetail),
            depends_on=f"{self._self(component)}/depends-on" if depends else None,
            belongs_to=area,
            capabilities=capabilities,
            links=self._links(component, links),
            x_medkit=attrs.evolve(
                self.blocks.component(component),
                type=component.type or None,
                parent_component_id=component.parent_component_id or None,
                depends_on=component.depends_on or None,
                area=component.area or None,
                variant=component.variant or None,
                description=component.description or None,
                capabilities=capabilities,
            ),
        )

    def app(self, app: App) -> AppDetail:
        href = self._self(app)
        optional, links = [], {}
        if app.component_id:
            optional += ["is-located-on", "belongs-to"]
            links["is-located-on"] = self._at("components", app.component_id)
            links["belongs-to"] = f"{href}/belongs-to"
        if app.depends_on:
            optional.append("depends-on")
        depends = [self._needed(one) for one in app.depends_on]
        return AppDetail(
            **self._head(app, AppDetail),
            translation_id=app.translation_id or None,
            is_located_on=links.get("is-located-on"),
            belongs_to=links.get("belongs-to"),
            depends_on=f"{href}/depends-on" if depends else None,
            capabilities=self._capabilities(app, optional, self._vendors()),
            links=self._links(app, {**links, **({"depends-on": depends} if depends else {})}),
            x_medkit=self.blocks.app(app),
        )

    def function(self, function: Function) -> FunctionDetail:
        depends = [self._at("functions", one) for one in function.depends_on]
        return FunctionDetail(
            **self._head(function, FunctionDetail),
            translation_id=function.translation_id or None,
            capabilities=self._capabilities(function),
            links=self._links(function, {"depends-on": depends} if depends else {}),
            x_medkit=attrs.evolve(
                self.blocks.function(function),
                hosts=function.hosts or None,
                description=function.description or None,
            ),
        )

    def _needed(self, entity_id: str) -> str:
        """Where what an app depends on is to be found: an app, unless it is a component."""
        tree = self.blocks.tree
        is_component = entity_id in tree.components and entity_id not in tree.apps
        return self._at("components" if is_component else "apps", entity_id)

    def _head(self, entity: Entity, cls: type[_Detail]) -> dict[str, Any]:
        """What needs no thought: who it is, and an address for each key that must have one."""
        head = common(entity)
        href = self._self(entity)
        for attribute in attrs.fields(cls):
            if attribute.default is attrs.NOTHING and attribute.name not in head:
                head[attribute.name] = f"{href}/{key_of(attribute)}"
        return head

    def _capabilities(self, entity: Entity, *more: Iterable[str]) -> Sequence[Open]:
        href = self._self(entity)
        names = [*_CAPABILITIES[type(entity)], *(name for names in more for name in names)]
        return [{"name": name, "href": f"{href}/{name}"} for name in names]

    def _vendors(self) -> Sequence[str]:
        return (BEACON, *self.blocks.gateway.vendor_endpoints)

    def _links(self, entity: Entity, more: Open) -> Open:
        collection = f"{self.base}/{COLLECTIONS[type(entity)]}"
        return {"self": f"{collection}/{entity.id}", "collection": collection, **more}

    def _self(self, entity: Entity) -> str:
        return self._at(COLLECTIONS[type(entity)], entity.id)

    def _at(self, collection: str, entity_id: str) -> str:
        return f"{self.base}/{collection}/{entity_id}"
