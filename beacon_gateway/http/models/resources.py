"""What entities have: data, operations, configurations, faults, logs, bulk data."""

from __future__ import annotations

import enum
from collections.abc import Sequence

import attrs

from beacon_gateway.http.models.base import Open, opaque, optional_key
from beacon_gateway.http.models.discovery import Listing
from beacon_gateway.http.models.medkit import DroppedItem, XMedkitRos2

__all__ = [
    "Aggregation",
    "BulkDataCategoryList",
    "ConfigListXMedkit",
    "ConfigXMedkitItem",
    "ConfigurationList",
    "ConfigurationMetaData",
    "DataItem",
    "DataListResult",
    "DataValue",
    "FaultListResult",
    "LogContext",
    "LogEntry",
    "LogEntryList",
    "LogListXMedkit",
    "OperationItem",
    "OperationList",
    "XMedkitDataItem",
    "XMedkitOperationItem",
]


@attrs.frozen(kw_only=True)
class XMedkitDataItem:
    """Where a value comes from, and what can be done with it."""

    middleware: str
    access: str
    direction: str
    type: str
    entity_id: str
    ros2: XMedkitRos2 | None = None


@attrs.frozen(kw_only=True)
class DataItem:
    """One data item of a list."""

    id: str
    name: str
    category: str
    value: object
    x_medkit: XMedkitDataItem = attrs.field(metadata={"key": "x-medkit"})


@opaque
@attrs.frozen(kw_only=True)
class DataListResult:
    """The data items of an entity, with their values."""

    items: Sequence[DataItem]
    x_medkit: Open = attrs.field(metadata={"key": "x-medkit"})


@opaque
@attrs.frozen(kw_only=True)
class DataValue:
    """One data item with its value, which is given twice: clients look in either place."""

    id: str
    data: object
    value: object
    x_medkit: XMedkitDataItem = attrs.field(metadata={"key": "x-medkit"})


@opaque
@attrs.frozen(kw_only=True)
class FaultListResult:
    """Faults. This gateway knows of none."""

    items: Sequence[Open]
    x_medkit: Open = attrs.field(metadata={"key": "x-medkit"})


@attrs.frozen(kw_only=True)
class XMedkitOperationItem:
    """What ROS says of an operation; clients know the form, here nothing fills it."""

    available: bool | None = None
    entity_id: str | None = None
    member_ids: Sequence[str] | None = None
    ros2: XMedkitRos2 | None = None
    source: str | None = None
    type_info: Open | None = None


@attrs.frozen(kw_only=True)
class OperationItem:
    """Something an entity could be told to do; here no entity has any."""

    id: str
    name: str
    proximity_proof_required: bool
    asynchronous_execution: bool
    x_medkit: XMedkitOperationItem | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class OperationList(Listing):
    """Operations. This gateway offers none."""

    items: Sequence[OperationItem]


@attrs.frozen(kw_only=True)
class ConfigXMedkitItem:
    """The node that has a parameter; here no entity tells of one."""

    node: str | None = None
    source: str | None = None


@attrs.frozen(kw_only=True)
class ConfigurationMetaData:
    """A parameter as a list tells of it; here no entity has any."""

    id: str
    name: str
    type: str
    x_medkit: ConfigXMedkitItem | None = optional_key("x-medkit")


@attrs.frozen(kw_only=True)
class ConfigListXMedkit:
    """Of a list of configurations."""

    aggregation_level: str | None = None
    entity_id: str | None = None
    failed_nodes: Sequence[str] | None = None
    failed_peers: Sequence[str] | None = None
    is_aggregated: bool | None = None
    parameters: object | None = None
    partial: bool | None = None
    peer_dropped_items: Sequence[DroppedItem] | None = None
    queried_nodes: Sequence[str] | None = None
    source: str | None = None
    source_ids: Sequence[str] | None = None
    unavailable_nodes: Sequence[str] | None = None


@attrs.frozen(kw_only=True)
class ConfigurationList:
    """Configurations. This gateway has none."""

    items: Sequence[ConfigurationMetaData]
    x_medkit: ConfigListXMedkit | None = optional_key("x-medkit")
    links: Open | None = optional_key("_links")


@attrs.frozen(kw_only=True)
class LogContext:
    """Where in a program a line was logged."""

    node: str
    file: str | None = None
    function: str | None = None
    line: int | None = None


@attrs.frozen(kw_only=True)
class LogEntry:
    """One line of a log; here no entity has any."""

    id: str
    timestamp: str
    severity: str
    message: str
    context: LogContext | None = None


class Aggregation(enum.StrEnum):
    """What log entries are gathered for."""

    FUNCTION = "function"
    AREA = "area"
    COMPONENT = "component"


@attrs.frozen(kw_only=True)
class LogListXMedkit:
    """Of a list of log entries."""

    aggregated: bool | None = None
    aggregation_level: Aggregation | None = None
    aggregation_sources: Sequence[str] | None = None
    app_count: int | None = None
    component_count: int | None = None
    contributors: Sequence[str] | None = None
    entity_id: str | None = None
    failed_peers: Sequence[str] | None = None
    host_count: int | None = None
    partial: bool | None = None
    peer_dropped_items: Sequence[DroppedItem] | None = None


@attrs.frozen(kw_only=True)
class LogEntryList:
    """Log entries. This gateway keeps none."""

    items: Sequence[LogEntry]
    x_medkit: LogListXMedkit | None = optional_key("x-medkit")
    links: Open | None = optional_key("_links")


@attrs.frozen(kw_only=True)
class BulkDataCategoryList:
    """Categories of bulk data. This gateway has none."""

    items: Sequence[str]
