"""A place for apps that nobody places: the computer the gateway runs on.

Clients walk from areas or components to apps, so an app without a component is invisible to them.
"""

from __future__ import annotations

import re
import socket

import attrs

from beacon_gateway.tree.entities import App, Area, Component, Entity, Tree

__all__ = ["HOST", "Host"]

HOST = "host"
"""The ``source`` of the component and the area that are made for it."""


@attrs.frozen
class Host:
    """The component, and the area it is in where there are areas."""

    id: str
    name: str
    area: str

    @classmethod
    def named(cls, component_id: str, name: str, area: str) -> Host:
        """Empty ones are worked out from this computer's name."""
        hostname = socket.gethostname() or "localhost"
        made = "host-" + re.sub(r"[^A-Za-z0-9_-]+", "-", hostname)[:200]
        return cls(component_id or made, name or hostname, area)

    def placed(self, entity: Entity) -> Entity:
        """The same, and here if it is an app that is nowhere."""
        if isinstance(entity, App) and not entity.component_id:
            return attrs.evolve(entity, component_id=self.id)
        return entity

    def component(self) -> Component:
        """The component, in no area."""
        return Component(self.id, self.name, source=HOST)

    def tree(self, manifest: Tree, *, hosting: bool, filled: bool) -> Tree:
        """What has to be there beside the manifest: the component while it is ``hosting``; where
        there are areas its own too, also while it is ``filled`` with other components."""
        area = self.area if manifest.areas else ""
        components = {self.id: attrs.evolve(self.component(), area=area)} if hosting else {}
        if not area or not (hosting or filled):
            return Tree(components=components)
        name = area.replace("_", " ").capitalize()
        return Tree(areas={area: Area(area, name, source=HOST)}, components=components)
