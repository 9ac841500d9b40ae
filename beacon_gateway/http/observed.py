"""What can be subscribed to: an entity's beacon, whole, as one carrier has it, or one field."""

from __future__ import annotations

from beacon_gateway.http import errors
from beacon_gateway.http.beacons import beacon_of, carrier_beacon_of
from beacon_gateway.http.data import data_value
from beacon_gateway.http.lookup import COLLECTIONS, named
from beacon_gateway.http.operations import API_BASE, Asked
from beacon_gateway.tree.entities import App, Component, Entity
from beacon_gateway.vendor import BEACON

__all__ = ["resource_within", "sample"]

_STANDARD = frozenset(
    {
        *("data", "operations", "configurations", "faults", "logs", "bulk-data"),
        *("triggers", "locks", "scripts", "cyclic-subscriptions"),
    }
)
"""Collections of the standard. Whatever else there is begins with ``x-``."""


def resource_within(asked: Asked, cls: type[Entity], resource: str) -> str:
    """What an address names within the entity that is asked about, such as ``data/status``.

    Raises ``ApiError`` if it names nothing that can be observed.
    """
    collection, entity_id, within = _split(asked, resource)
    if (collection, entity_id) != (COLLECTIONS[cls], asked.id):
        raise _refused(
            "entity-mismatch", "Resource URI must reference the same entity as the route", resource
        )
    what, _, item = within.partition("/")
    if what not in _STANDARD and not what.startswith("x-"):
        raise _refused("invalid-resource-uri", "Unknown collection in the resource URI", resource)
    if what == "data" and not item:
        raise _refused("invalid-resource-uri", "Data collection requires a data item", resource)
    if what != "data" and item:
        raise _refused("invalid-resource-uri", "This collection is sent as a whole", resource)
    if not _can_be_observed(asked, cls, what):
        raise _refused("collection-not-available", "Nothing is sent of this collection", resource)
    return within


def sample(asked: Asked, cls: type[Entity], within: str) -> object:
    """What is sent now. Raises ``ApiError`` if there is nothing to send."""
    what, _, item = within.partition("/")
    if what == "data":
        return data_value(asked, named(asked, cls), item)
    assert issubclass(cls, App | Component)  # noqa: S101 - no other has a beacon
    if what == BEACON:
        return beacon_of(cls, asked)
    return carrier_beacon_of(cls, asked.gateway.vendor_endpoints[what], asked)


def _split(asked: Asked, resource: str) -> tuple[str, str, str]:
    """Collection, id and the rest of an address."""
    for base in (asked.base, API_BASE):
        collection, _, rest = resource.removeprefix(f"{base}/").partition("/")
        entity_id, _, within = rest.partition("/")
        if resource.startswith(f"{base}/") and within and not _wanders(within):
            return collection, entity_id, within
    raise _refused("invalid-resource-uri", "Invalid resource URI", resource)


def _wanders(path: str) -> bool:
    return any(segment in ("", ".", "..") for segment in path.split("/"))


def _can_be_observed(asked: Asked, cls: type[Entity], what: str) -> bool:
    if not issubclass(cls, App | Component):
        return False
    return what in ("data", BEACON) or what in asked.gateway.vendor_endpoints


def _refused(code: str, message: str, resource: str) -> errors.ApiError:
    parameters = {"parameter": "resource", "value": resource[:256]}
    return errors.ApiError(400, f"x-medkit-{code}", message, parameters)
