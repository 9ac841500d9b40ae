"""What can be configured of asking nodes of rmw_zenoh for their parameters."""

from __future__ import annotations

import attrs

from beacon_core.parameters import polling
from beacon_zenoh.rmw.options import RmwSessionOptions

__all__ = ["RmwParamOptions"]


@attrs.frozen
class RmwParamOptions(RmwSessionOptions):
    """``adapter: zenoh_rmw_param`` in a configuration, of a source or of an announcer.

    ``ConfigError`` for a value that cannot be. A configuration file's ``interval_s``, ``budget_s``,
    ``timeout_s`` and ``max_in_flight`` are lifted to the least that can be, with a warning. What
    they mean is said in :mod:`beacon_core.parameters.polling`.
    """

    targets: tuple[str, ...] = polling.targets()
    interval_s: float = polling.interval_s()
    budget_s: float = polling.budget_s()
    timeout_s: float = polling.timeout_s()
    max_in_flight: int = polling.max_in_flight()
    parameter_events: bool = polling.parameter_events()

    @property
    def forget_after_s(self) -> float:
        """At once: it takes nothing to ask a node that would be worth keeping."""
        return 0.0
