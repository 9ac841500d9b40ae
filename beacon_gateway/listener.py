"""One configured source at work: carrier -> intake -> store."""

from __future__ import annotations

from beacon_core.clock import Clock
from beacon_core.errors import BeaconError, ConfigError
from beacon_core.intake import Intake
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
        departures: Departures,
        targets: frozenset[str] | None = None,
    ) -> None:
        """Opens nothing. Raises ``ConfigError``, led by the source's place in the configuration.

        ``departures`` is told who went.
        ``targets``: the nodes of the gateway's apps, for a source that asks them; ``None``: it
        finds out by itself.
        """
        self.name = name
        self.adapter = adapter.name
        self.max_hints = config.max_hints
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
            if targets is not None:
                self.take_targets(targets)
        except BeaconError as error:
            raise self._at_its_place(error) from error

    def start(self) -> None:
        """Begin to listen. Raises ``ConfigError`` for what no amount of trying can mend."""
        try:
            self.source.start(Witness(self.intake, self.store, self._note_departure))
        except BeaconError as error:
            raise self._at_its_place(error) from error

    @property
    def asks(self) -> bool:
        """Its source asks nodes, and so wants to know whom."""
        return isinstance(self.source, Targeted)

    def take_targets(self, targets: frozenset[str] | None) -> None:
        """From now on these are the nodes of the gateway's apps."""
        if isinstance(self.source, Targeted):
            self.source.set_targets(targets)

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

    def _note_departure(self, stored: StoredHint) -> None:
        self._departures.note(View(self.name, self.adapter, stored))

    def _at_its_place(self, error: BeaconError) -> ConfigError:
        return ConfigError(f"$.sources.{self.name}: {error}")
