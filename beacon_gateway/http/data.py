"""What a beacon says, as data items of the standard: so that any client shows it.

Apps and components have an item for each field of their beacon; areas and functions have none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from starlette.routing import BaseRoute

from beacon_core.lifecycle import Status
from beacon_core.response import build_response
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import errors
from beacon_gateway.http.lookup import COLLECTIONS, named
from beacon_gateway.http.models.medkit import XMedkitRos2
from beacon_gateway.http.models.resources import (
    DataItem,
    DataListResult,
    DataValue,
    XMedkitDataItem,
)
from beacon_gateway.http.operations import Asked, Operation, route
from beacon_gateway.tree.entities import App, Area, Component, Entity, Function

__all__ = ["data_value", "routes"]

_NOW, _IDENTITY, _SYSTEM = "currentData", "identData", "sysInfo"

_ITEMS: Mapping[str, tuple[str, str, str]] = {
    "status": ("Beacon status", _NOW, "string"),
    "age_sec": ("Seconds since it was heard", _NOW, "number"),
    "stable_id": ("Stable id", _IDENTITY, "string"),
    "display_name": ("Display name", _IDENTITY, "string"),
    "transport_type": ("Transport", _SYSTEM, "string"),
    "negotiated_format": ("Negotiated format", _SYSTEM, "string"),
    "process_id": ("Process id", _SYSTEM, "integer"),
    "process_name": ("Process name", _SYSTEM, "string"),
    "hostname": ("Host", _SYSTEM, "string"),
    "component_id": ("Component", _IDENTITY, "string"),
    "function_ids": ("Functions", _IDENTITY, "array"),
    "depends_on": ("Depends on", _IDENTITY, "array"),
    "metadata": ("Metadata", _IDENTITY, "object"),
}
"""Of each field its name for people, its category and its type."""


def routes(gateway: Gateway) -> list[BaseRoute]:
    """The same for each kind of entity."""
    made: list[BaseRoute] = []
    for cls in (App, Component, Area, Function):
        kind = cls.__name__
        path = f"/{COLLECTIONS[cls]}/{{{kind.lower()}_id}}/data"
        listing = Operation(
            id=f"list{kind}Data",
            tag="Data",
            path=path,
            summary="The fields of its beacon, as data items",
            body=DataListResult,
        )
        one = Operation(
            id=f"get{kind}DataItem",
            tag="Data",
            path=f"{path}/{{data_id}}",
            summary="One field of its beacon",
            body=DataValue,
        )
        made.append(route(gateway, listing, partial(_data, cls)))
        made.append(route(gateway, one, partial(_item, cls)))
    return made


def data_value(asked: Asked, entity: Entity, data_id: str) -> DataValue:
    """One item. Raises ``ApiError`` if there is no such item now."""
    values = _values(asked, entity)
    if data_id not in values:
        raise errors.no_such_resource(
            "Data item not found", entity_id=entity.id, data_id=data_id[:256]
        )
    value = values[data_id]
    return DataValue(id=data_id, data=value, value=value, x_medkit=_x_medkit(entity, data_id))


def _data(cls: type[Entity], asked: Asked) -> DataListResult:
    entity = named(asked, cls)
    items: Sequence[DataItem] = [
        DataItem(
            id=data_id,
            name=_ITEMS[data_id][0],
            category=_ITEMS[data_id][1],
            value=value,
            x_medkit=_x_medkit(entity, data_id),
        )
        for data_id, value in _values(asked, entity).items()
    ]
    return DataListResult(items=items, x_medkit={"entity_id": entity.id, "total_count": len(items)})


def _item(cls: type[Entity], asked: Asked) -> DataValue:
    return data_value(asked, named(asked, cls), asked.params["data_id"])


def _values(asked: Asked, entity: Entity) -> Mapping[str, object]:
    if not isinstance(entity, App | Component):
        return {}
    beacon = asked.gateway.directory.beacon(entity.id)
    if beacon is None or beacon.status is Status.LEFT:
        return {}
    body = build_response(beacon.stored, asked.gateway.clock.monotonic_ns())
    return {data_id: body[data_id] for data_id in _ITEMS}


def _x_medkit(entity: Entity, data_id: str) -> XMedkitDataItem:
    kind = _ITEMS[data_id][2]
    return XMedkitDataItem(
        middleware="beacon",
        access="read",
        direction="output",
        type=kind,
        entity_id=entity.id,
        ros2=XMedkitRos2(direction="publish", type=kind),
    )
