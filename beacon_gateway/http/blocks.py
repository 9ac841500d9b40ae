"""The ``x-medkit`` blocks of entities, and what their beacons say, as they are now."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import attrs

from beacon_core.stored import StoredHint
from beacon_gateway.gateway import Gateway
from beacon_gateway.http.models.medkit import (
    BeaconSummary,
    XMedkitApp,
    XMedkitArea,
    XMedkitComponent,
    XMedkitFunction,
    XMedkitRos2,
)
from beacon_gateway.tree.entities import App, Area, Component, Function, Tree
from beacon_gateway.tree.rollup import RollUp
from beacon_gateway.views import Beacon

__all__ = ["Blocks", "Life", "evidence", "process"]


@attrs.frozen
class Life:
    """How an app or a component is, besides what is written down about it."""

    beacon: Beacon | None
    never_heard: bool
    functions: Sequence[str] | None
    dependencies: Mapping[str, Any]

    @property
    def gist(self) -> tuple[object, ...]:
        """What all of it follows from but ages; equal while nothing else has changed."""
        views = () if self.beacon is None else self.beacon.views
        said = tuple([(view.source, view.stored.revision) for view in views])
        return said, self.never_heard, self.functions, self.dependencies


@attrs.frozen(slots=False)
class Blocks:
    """Makes the blocks of one answer, all at the same moment."""

    gateway: Gateway
    tree: Tree
    many: bool = False
    """Of many entities: what is worked out for all at once is cheaper then."""

    def area(self, area: Area) -> XMedkitArea | None:
        if not area.namespace:
            return None
        return XMedkitArea(ros2=XMedkitRos2(namespace=area.namespace))

    def component(self, component: Component) -> XMedkitComponent:
        ros2 = XMedkitRos2(node=component.fqn or None, namespace=component.namespace or None)
        return XMedkitComponent(
            source=component.source,
            ros2=ros2 if ros2 != XMedkitRos2() else None,
            identity=dict(component.identity) or None,
            external=component.external or None,
            **self._life(component),
        )

    def app(self, app: App, life: Life | None = None, age_sec: float | None = None) -> XMedkitApp:
        """``life`` if it is known already; ``age_sec`` to be told instead of the beacon's."""
        life = life or self.life(app)
        return XMedkitApp(
            source=app.source,
            is_online=app.is_online or (life.beacon is not None and life.beacon.online),
            component_id=app.component_id or None,
            ros2=XMedkitRos2(node=app.bound_fqn) if app.bound_fqn else None,
            external=app.external or None,
            **self._told(life, age_sec),
        )

    def as_app(self, component: Component) -> XMedkitApp:
        """Of a component where clients expect an app."""
        return XMedkitApp(source=component.source, **self._life(component))

    def as_component(self, app: App) -> XMedkitComponent:
        """Of an app where clients expect a component."""
        return XMedkitComponent(source=app.source, **self._life(app))

    def function(self, function: Function) -> XMedkitFunction:
        return XMedkitFunction(source=function.source)

    def functions_of(self, entity_id: str) -> Sequence[str] | None:
        """In which it takes part; ``None``: in none."""
        return self._functions_of.get(entity_id)

    def dependencies(self, entity: App | Component) -> dict[str, Any]:
        """Whether all it depends on is active, and if not, the way to what is not."""
        if not entity.depends_on:
            return {}
        needed = [self._roll_up(one) for one in entity.depends_on]
        failing = [one for one in needed if not one.active]
        if not failing:
            return {"depends_on_active": True}
        nearest = min(failing, key=lambda one: len(one.chain))
        return {
            "depends_on_active": False,
            "depends_on_reason": nearest.reason,
            "reason_chain": (entity.id, *nearest.chain),
        }

    def _roll_up(self, entity_id: str) -> RollUp:
        found = self._roll_ups.get(entity_id) if self.many else None
        return found or self.gateway.directory.roll_up(entity_id)

    def life(self, entity: App | Component) -> Life:
        """How it is now."""
        beacon = self.gateway.directory.beacon(entity.id)
        return Life(
            beacon,
            beacon is None and self.gateway.directory.never_heard(entity.id),
            self.functions_of(entity.id),
            self.dependencies(entity) if entity.depends_on else {},
        )

    def evidence(self, app: App) -> tuple[object, ...]:
        """What its life follows from, besides the app itself; all the same objects while nothing
        of it has changed, and it has a beacon."""
        if app.depends_on:
            return (self.tree.functions, self._roll_ups, *self._evidence(app.id))
        return (self.tree.functions, *self._evidence(app.id))

    def _life(self, entity: App | Component) -> dict[str, Any]:
        return self._told(self.life(entity))

    def _told(self, life: Life, age_sec: float | None = None) -> dict[str, Any]:
        told: dict[str, Any] = {"functions": life.functions, **life.dependencies}
        if life.beacon is not None:
            age_ns = life.beacon.stored.age_ns(self.now_ns)
            told["beacon"] = _summary(life.beacon, age_ns / 1e9 if age_sec is None else age_sec)
        elif life.never_heard:
            told |= {"expected": True, "never_heard": True}
        return told

    @cached_property
    def now_ns(self) -> int:
        """The one moment, on the monotonic clock."""
        return self.gateway.clock.monotonic_ns()

    @cached_property
    def _evidence(self) -> Callable[[str], tuple[object, ...]]:
        return self.gateway.directory.evidence()

    @cached_property
    def _roll_ups(self) -> Mapping[str, RollUp]:
        return self.gateway.directory.roll_ups()

    @cached_property
    def _functions_of(self) -> Mapping[str, list[str]]:
        members: dict[str, list[str]] = defaultdict(list)
        for function in self.tree.functions.values():
            for host in function.hosts:
                members[host].append(function.id)
        return dict(members)


def evidence(stored: StoredHint) -> dict[str, Any]:
    """Why it has the status it has."""
    cause = {"cause": stored.cause.value}
    return {**cause, "reason": stored.detail} if stored.detail else cause


def process(stored: StoredHint) -> dict[str, Any]:
    """Which process on which host speaks, as far as it says."""
    hint = stored.hint
    return {
        "hostname": hint.hostname or None,
        "process_id": hint.process_id or None,
        "process_name": hint.process_name or None,
    }


def _summary(beacon: Beacon, age_sec: float) -> BeaconSummary:
    stored = beacon.stored
    return BeaconSummary(
        source=beacon.freshest.source,
        status=stored.status.value,
        age_sec=age_sec,
        restarts=stored.restarts,
        conflict=beacon.conflict,
        **evidence(stored),
        **process(stored),
    )
