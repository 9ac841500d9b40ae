"""What may stand in a manifest, entry by entry, and the entities they mean."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import attrs

from beacon_gateway.ids import an_id, an_id_or_empty, ids
from beacon_gateway.tree.entities import App, Area, Component, Function, RosBinding
from beacon_gateway.tree.linker import Unmanifested

__all__ = [
    "AppEntry",
    "AreaEntry",
    "BindingEntry",
    "ComponentEntry",
    "Entry",
    "FunctionEntry",
    "PolicyEntry",
]

_ID = {"right": "an id"}


def _space(_: object, __: object, value: str) -> None:
    if value not in ("", "*") and not value.startswith("/"):
        raise ValueError(f"found {ascii(value)[:60]}; give a namespace that begins with /, or *")


@attrs.frozen
class PolicyEntry:
    """``config``: how the manifest is merged with what is found."""

    unused: ClassVar[frozenset[str]] = frozenset()

    unmanifested_nodes: Unmanifested = Unmanifested.WARN
    inherit_runtime_resources: bool = True
    allow_manifest_override: bool = True


@attrs.frozen(kw_only=True)
class Entry:
    """What every entity may have."""

    unused: ClassVar[frozenset[str]] = frozenset({"category"})
    """Keys that ros2_medkit documents and reads past too."""

    id: str = attrs.field(validator=an_id, metadata=_ID)
    name: str = ""
    description: str = ""
    tags: tuple[str, ...] = ()
    translation_id: str = ""

    def common(self) -> dict[str, Any]:
        """The same as the entity has it."""
        return {
            "id": self.id,
            "name": self.name or self.id,
            "description": self.description,
            "tags": self.tags,
            "translation_id": self.translation_id,
        }


@attrs.frozen(kw_only=True)
class AreaEntry(Entry):
    """An area. ``subareas`` are not among the fields: whoever walks the document takes them out."""

    unused: ClassVar[frozenset[str]] = Entry.unused | {"subareas"}

    namespace: str = attrs.field(default="", validator=_space)
    parent_area: str = attrs.field(default="", validator=an_id_or_empty)
    parent_area_id: str = attrs.field(default="", validator=an_id_or_empty)

    @property
    def parent(self) -> str:
        """ros2_medkit's documents say ``parent_area_id``, and its parser ``parent_area``."""
        return self.parent_area or self.parent_area_id

    def entity(self, within: str = "") -> Area:
        """``within``: the area in whose ``subareas`` it stands."""
        return Area(
            **self.common(),
            namespace=self.namespace or f"/{self.id}",
            parent_area_id=within or self.parent,
        )


@attrs.frozen(kw_only=True)
class ComponentEntry(Entry):
    """A component."""

    unused: ClassVar[frozenset[str]] = Entry.unused | {"lock"}

    type: str = ""
    area: str = attrs.field(default="", validator=an_id_or_empty)
    namespace: str = attrs.field(default="", validator=_space)
    variant: str = ""
    parent_component_id: str = attrs.field(default="", validator=an_id_or_empty)
    depends_on: tuple[str, ...] = attrs.field(default=(), validator=ids)
    external: bool | None = None
    identity: Mapping[str, str] = attrs.Factory(dict)

    def entity(self) -> Component:
        """The component it means."""
        return Component(
            **self.common(),
            type=self.type,
            area=self.area,
            namespace=self.namespace,
            fqn=f"{self.namespace.rstrip('/')}/{self.id}",
            variant=self.variant,
            parent_component_id=self.parent_component_id,
            depends_on=self.depends_on,
            external=self.external,
            identity=self.identity,
        )


@attrs.frozen
class BindingEntry:
    """``ros_binding`` of an app."""

    unused: ClassVar[frozenset[str]] = frozenset()

    node_name: str = ""
    namespace: str = attrs.field(default="", validator=_space)
    topic_namespace: str = attrs.field(default="", validator=_space)

    def value(self) -> RosBinding:
        """The binding it means."""
        return RosBinding(self.node_name, self.namespace, self.topic_namespace)


@attrs.frozen(kw_only=True)
class AppEntry(Entry):
    """An app."""

    unused: ClassVar[frozenset[str]] = Entry.unused | {"lock"}

    is_located_on: str = attrs.field(default="", validator=an_id_or_empty)
    depends_on: tuple[str, ...] = attrs.field(default=(), validator=ids)
    external: bool | None = None
    ros_binding: BindingEntry | None = None

    def entity(self) -> App:
        """The app it means."""
        return App(
            **self.common(),
            component_id=self.is_located_on,
            depends_on=self.depends_on,
            external=self.external,
            ros_binding=None if self.ros_binding is None else self.ros_binding.value(),
        )


@attrs.frozen(kw_only=True)
class FunctionEntry(Entry):
    """A function."""

    hosted_by: tuple[str, ...] = attrs.field(default=(), validator=ids)
    depends_on: tuple[str, ...] = attrs.field(default=(), validator=ids)

    def entity(self) -> Function:
        """The function it means."""
        return Function(**self.common(), hosts=self.hosted_by, depends_on=self.depends_on)
