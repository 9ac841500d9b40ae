"""One configured source at work: carrier -> intake -> store -> mapper."""

from __future__ import annotations

import threading

from beacon_core.clock import Clock
from beacon_core.entities import Entities
from beacon_core.errors import BeaconError, ConfigError
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.mapper import IncrementalMapper
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.graph import Graph
from beacon_core.ports.targeted import Targeted
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint
from beacon_gateway.config import SourceConfig
from beacon_gateway.departures import Departures, Witness
from beacon_gateway.views import View

__all__ = ["Listener"]


class Listener:
    """Thread rule: every method may be called from any thread; ``start`` once."""

    def __init__(
        self,
        name: str,
        config: SourceConfig,
        adapter: Adapter,
        clock: Clock,
        *,
        allow_new_entities: bool,
        departures: Departures,
        targets: frozenset[str] = frozenset(),
    ) -> None:
        """Opens nothing. Raises ``ConfigError``, led by the source's place in the configuration.

        ``departures`` is told who went.
        ``targets``: the nodes of the gateway's apps, for a source that asks them; none: it finds
        out by itself.
        """
        self.name = name
        self.adapter = adapter.name
        self.max_hints = config.max_hints
        self._allow_new_entities = allow_new_entities
        self._departures = departures
        try:
            self.store = HintStore(
                clock, ttl_s=config.ttl_s, expiry_s=config.expiry_s, max_hints=config.max_hints
            )
            self.intake = Intake(
                self.store,
                adapter.decode,
                source_rate=config.source_rate,
                global_rate=config.global_rate,
                skew_policy=config.skew_policy,
            )
            self.source = adapter.source(config.options)
            if targets and isinstance(self.source, Targeted):
                self.source.set_targets(targets)
        except BeaconError as error:
            raise self._at_its_place(error) from error
        self._mapper = IncrementalMapper(self.store, allow_new_entities=allow_new_entities)
        self._lock = threading.Lock()
        self._left: dict[str, None] = {}
        self._left_revision = 0

    def start(self) -> None:
        """Begin to listen. Raises ``ConfigError`` for what no amount of trying can mend."""
        try:
            self.source.start(Witness(self.intake, self.store, self._note_departure))
        except BeaconError as error:
            raise self._at_its_place(error) from error

    def take_targets(self, targets: frozenset[str]) -> None:
        """From now on these are the nodes of the gateway's apps."""
        if isinstance(self.source, Targeted):
            self.source.set_targets(targets or None)

    def close(self) -> None:
        """Stop listening; see :meth:`beacon_core.ports.source.HintSource.close`."""
        self.source.close()

    @property
    def knows_nodes(self) -> bool:
        """Its carrier shows the ROS graph."""
        return isinstance(self.source, Graph)

    def nodes(self) -> frozenset[str]:
        """The nodes of the ROS graph; see :class:`beacon_core.ports.graph.Graph`."""
        return self.source.nodes() if isinstance(self.source, Graph) else frozenset()

    def new_app_ids(self, known: Entities) -> dict[str, None]:
        """The apps nobody but their own hint told of, in a stable order.

        Those who said goodbye are among them until their tombstone lapses.
        """
        with self._lock:
            left = self._left_now()
            shadows = self._mapper.introspect(known).new_apps
            # One that came back or left while the mapper looked is in one of the three.
            left |= self._left_now()
        ids = {app.id: None for app in shadows if app.id not in known.apps}
        if self._allow_new_entities:
            ids.update(
                (entity_id, None)
                for entity_id in left
                if entity_id not in known.apps and entity_id not in known.components
            )
        return ids

    def _note_departure(self, stored: StoredHint) -> None:
        self._departures.note(View(self.name, self.adapter, stored))

    def _left_now(self) -> dict[str, None]:
        changes = self.store.changes_since(self._left_revision)
        self._left_revision = changes.revision
        if changes.complete:
            self._left = {}
        for entity_id in changes.gone:
            self._left.pop(entity_id, None)
        for stored in changes.hints:
            if stored.status is Status.LEFT:
                self._left[stored.entity_id] = None
            else:
                self._left.pop(stored.entity_id, None)
        return dict(self._left)

    def _at_its_place(self, error: BeaconError) -> ConfigError:
        return ConfigError(f"$.sources.{self.name}: {error}")
