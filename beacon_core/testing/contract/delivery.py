"""What is announced arrives: whole, in order, unchanged."""

from __future__ import annotations

import attrs

from beacon_core.testing.contract.base import ContractBase, hint
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.testing.harness import Harness, Listener

__all__ = ["DeliveryChecks"]


class DeliveryChecks(ContractBase):
    """From ``announce`` to the store."""

    def test_a_hint_arrives(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")

    def test_every_field_arrives_intact(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        harness.announcer().announce(BENCH_HINT)
        self.active(harness, listener, BENCH_HINT.entity_id)
        stored = listener.store.get(BENCH_HINT.entity_id)
        assert stored is not None
        assert stored.hint == attrs.evolve(BENCH_HINT, metadata=dict(BENCH_HINT.metadata))
