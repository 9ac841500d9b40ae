"""What an entity might have besides data, and has not here: valid, and empty.

Clients ask for all of it as soon as somebody opens an entity, and complain if nothing answers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from starlette.routing import BaseRoute

from beacon_gateway.gateway import Gateway
from beacon_gateway.http.lookup import COLLECTIONS, named
from beacon_gateway.http.models.medkit import XMedkitCollection
from beacon_gateway.http.models.resources import (
    BulkDataCategoryList,
    ConfigListXMedkit,
    ConfigurationList,
    FaultListResult,
    LogEntryList,
    LogListXMedkit,
    OperationList,
)
from beacon_gateway.http.operations import Asked, Operation, Parameter, route
from beacon_gateway.tree.entities import App, Area, Component, Entity, Function

__all__ = ["FAULT_STATUS", "no_faults", "routes"]

FAULT_STATUS = Parameter(
    name="status", choices=("pending", "confirmed", "cleared", "healed", "all")
)
"""Which faults are asked for; checked although there are none, as clients expect."""

_SEVERITY = Parameter(name="severity", choices=("debug", "info", "warning", "error", "fatal"))

_Empty = Callable[[Entity], object]


def routes(gateway: Gateway) -> list[BaseRoute]:
    """The same for each kind of entity."""
    return [
        route(gateway, operation, partial(_emptiness, cls, empty))
        for cls in (App, Component, Area, Function)
        for operation, empty in _operations(cls)
    ]


def no_faults() -> FaultListResult:
    """Faults are told by others than beacons."""
    return FaultListResult(items=[], x_medkit={"count": 0})


def _operations(cls: type[Entity]) -> Iterator[tuple[Operation, _Empty]]:
    kind = cls.__name__
    path = f"/{COLLECTIONS[cls]}/{{{kind.lower()}_id}}"
    for what, tag, body, empty in (
        ("operations", "Operations", OperationList, _no_operations),
        ("configurations", "Configuration", ConfigurationList, _no_configurations),
        ("faults", "Faults", FaultListResult, _no_faults_of),
        ("logs", "Logs", LogEntryList, _no_logs),
        ("bulk-data", "Bulk Data", BulkDataCategoryList, _no_bulk_data),
    ):
        operation = Operation(
            id=f"list{kind}{_NAMES[what]}",
            tag=tag,
            path=f"{path}/{what}",
            summary=f"Always empty: no {what.replace('-', ' ')} are known here",
            body=body,
            parameters=_PARAMETERS.get(what, ()),
        )
        yield operation, empty


_NAMES: Mapping[str, str] = {
    "operations": "Operations",
    "configurations": "Configurations",
    "faults": "Faults",
    "logs": "Logs",
    "bulk-data": "BulkDataCategories",
}
_PARAMETERS: Mapping[str, tuple[Parameter, ...]] = {
    "faults": (FAULT_STATUS,),
    "logs": (_SEVERITY, Parameter(name="context")),
}


def _emptiness(cls: type[Entity], empty: _Empty, asked: Asked) -> object:
    return empty(named(asked, cls))


def _no_operations(_: Entity) -> OperationList:
    return OperationList(items=[], x_medkit=XMedkitCollection(total_count=0))


def _no_configurations(entity: Entity) -> ConfigurationList:
    return ConfigurationList(items=[], x_medkit=ConfigListXMedkit(entity_id=entity.id))


def _no_faults_of(_: Entity) -> FaultListResult:
    return no_faults()


def _no_logs(entity: Entity) -> LogEntryList:
    return LogEntryList(items=[], x_medkit=LogListXMedkit(entity_id=entity.id))


def _no_bulk_data(_: Entity) -> BulkDataCategoryList:
    return BulkDataCategoryList(items=[])
