"""Lines of collections: one entity each, or a reference to one that is not there."""

from __future__ import annotations

from typing import Any

import attrs

from beacon_gateway.http.blocks import Blocks, Life
from beacon_gateway.http.lookup import COLLECTIONS
from beacon_gateway.http.models.discovery import (
    AppListItem,
    AreaListItem,
    ComponentListItem,
    EntityType,
    FunctionListItem,
)
from beacon_gateway.http.models.medkit import XMedkitApp, XMedkitArea, XMedkitComponent
from beacon_gateway.http.operations import Asked
from beacon_gateway.tree.entities import App, Area, Component, Entity, Function

__all__ = ["Items", "common"]


@attrs.frozen
class Items:
    """Makes the lines of one answer, all at the same moment."""

    base: str
    blocks: Blocks

    @classmethod
    def of(cls, asked: Asked) -> Items:
        return cls(asked.base, Blocks(asked.gateway, asked.tree, many=True))

    def area(self, area: Area) -> AreaListItem:
        return AreaListItem(x_medkit=self.blocks.area(area), **self._head(area))

    def component(self, component: Component) -> ComponentListItem:
        return ComponentListItem(x_medkit=self.blocks.component(component), **self._head(component))

    def app(self, app: App, life: Life | None = None, age_sec: float | None = None) -> AppListItem:
        """The last two as :meth:`.Blocks.app` takes them."""
        block = self.blocks.app(app, life, age_sec)
        return AppListItem(x_medkit=block, **self._head(app))

    def function(self, function: Function) -> FunctionListItem:
        return FunctionListItem(x_medkit=self.blocks.function(function), **self._head(function))

    def needed_by_app(self, entity_id: str) -> AppListItem:
        """What an app depends on: an app; or a component, told of as an app is; or nobody."""
        tree = self.blocks.tree
        if entity_id in tree.apps:
            return self.app(tree.apps[entity_id])
        if entity_id not in tree.components:
            return AppListItem(x_medkit=XMedkitApp(missing=True), **self._head(App(entity_id)))
        component = tree.components[entity_id]
        return AppListItem(x_medkit=self.blocks.as_app(component), **self._head(component))

    def needed_by_component(self, entity_id: str) -> ComponentListItem:
        """What a component depends on: the same the other way round."""
        tree = self.blocks.tree
        if entity_id in tree.components:
            return self.component(tree.components[entity_id])
        if entity_id not in tree.apps:
            return self.missing_component(entity_id)
        app = tree.apps[entity_id]
        return ComponentListItem(x_medkit=self.blocks.as_component(app), **self._head(app))

    def missing_area(self, area_id: str) -> AreaListItem:
        """Somebody refers to it, and there is none."""
        return AreaListItem(x_medkit=XMedkitArea(missing=True), **self._head(Area(area_id)))

    def unknown_area(self, component_id: str) -> AreaListItem:
        """The area of a component that somebody refers to and that is not there."""
        return AreaListItem(
            id="",
            name="<unknown area>",
            href="",
            type=EntityType.AREA,
            x_medkit=XMedkitArea(missing=True, unresolved_component=component_id),
        )

    def missing_component(self, component_id: str) -> ComponentListItem:
        """Somebody refers to it, and there is none."""
        return ComponentListItem(
            x_medkit=XMedkitComponent(missing=True), **self._head(Component(component_id))
        )

    def _head(self, entity: Entity) -> dict[str, Any]:
        return {"href": self.href(entity), **common(entity)}

    def href(self, entity: Entity) -> str:
        """Where an entity is to be found."""
        return f"{self.base}/{COLLECTIONS[type(entity)]}/{entity.id}"


def common(entity: Entity) -> dict[str, Any]:
    """What every line and every detail begins with."""
    return {
        "id": entity.id,
        "name": entity.name or entity.id,
        "type": EntityType(type(entity).__name__.lower()),
        "description": entity.description or None,
        "tags": entity.tags or None,
    }
