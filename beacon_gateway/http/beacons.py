"""The vendor endpoints: an entity's beacon, in full or as one carrier has it."""

from __future__ import annotations

from functools import partial

from starlette.routing import BaseRoute

from beacon_core.lifecycle import Status
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import errors
from beacon_gateway.http.beacon_bodies import beacon_body, carrier_body, left_parameters
from beacon_gateway.http.blocks import Blocks
from beacon_gateway.http.lookup import COLLECTIONS, vendors
from beacon_gateway.http.models.beacons import Beacon as BeaconBody
from beacon_gateway.http.models.beacons import CarrierBeacon
from beacon_gateway.http.operations import Asked, Operation, route
from beacon_gateway.http.snapshots import Snapshots
from beacon_gateway.tree.entities import App, Component
from beacon_gateway.vendor import BEACON

__all__ = ["beacon_of", "carrier_beacon_of", "routes"]

_OWNERS: tuple[type[App | Component], ...] = (App, Component)


def routes(gateway: Gateway, kept: Snapshots) -> list[BaseRoute]:
    """Ours, and one for each endpoint that a configured adapter brings."""
    made: list[BaseRoute] = []
    for cls in _OWNERS:
        name = cls.__name__
        path = f"/{COLLECTIONS[cls]}/{{{name.lower()}_id}}"
        ours = Operation(
            id=f"get{name}Beacon",
            tag="Beacons",
            path=f"{path}/{BEACON}",
            summary="Its beacon, in full: the freshest view, and every source's",
            body=BeaconBody,
        )
        made.append(route(gateway, ours, partial(beacon_of, cls), kept=kept))
        for endpoint, adapters in gateway.vendor_endpoints.items():
            theirs = Operation(
                id=f"get{name}{_camel(endpoint)}",
                tag="Beacons",
                path=f"{path}/{endpoint}",
                summary="Its beacon as one carrier has it",
                body=CarrierBeacon,
            )
            handler = partial(carrier_beacon_of, cls, adapters)
            made.append(route(gateway, theirs, handler, kept=kept))
    return made


def beacon_of(cls: type[App | Component], asked: Asked) -> BeaconBody:
    """The body of our endpoint. Raises ``ApiError`` if there is no beacon."""
    entity: App | Component = vendors(asked, cls)
    beacon = asked.gateway.directory.beacon(entity.id)
    if beacon is None:
        raise errors.beacon_not_found({"entity_id": entity.id})
    if beacon.status is Status.LEFT:
        raise errors.beacon_not_found(left_parameters(beacon, asked.gateway.clock))
    return beacon_body(entity, beacon, Blocks(asked.gateway, asked.tree))


def carrier_beacon_of(
    cls: type[App | Component], adapters: frozenset[str], asked: Asked
) -> CarrierBeacon:
    """The body of a carrier's endpoint. Raises ``ApiError`` if it has no beacon."""
    beacon = asked.gateway.directory.beacon(vendors(asked, cls).id)
    heard = None if beacon is None else beacon.heard_by(adapters)
    if heard is None or heard.status is Status.LEFT:
        raise errors.beacon_not_found()
    return carrier_body(heard, asked.gateway.clock.monotonic_ns())


def _camel(endpoint: str) -> str:
    """``TopicBeacon`` for ``x-medkit-topic-beacon``."""
    words = endpoint.removeprefix("x-").removeprefix("medkit-").split("-")
    return "".join(word.capitalize() for word in words)
