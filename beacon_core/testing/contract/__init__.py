"""The contract suite: what every adapter, ours or a stranger's, is run through.

Make a subclass whose name pytest collects, and give it a harness::

    class TestMyAdapter(AdapterContract):
        def make_harness(self) -> Harness:
            return MyHarness()

Needs pytest and hypothesis (the extra ``test``). See docs/write-your-own-adapter.md.
"""

from __future__ import annotations

import pytest

pytest.register_assert_rewrite(
    *(
        f"{__name__}.{name}"
        for name in ("base", "bounds", "closing", "delivery", "faults", "lifecycle")
    )
)

# Below, because pytest must be told before the modules are imported.
from beacon_core.testing.contract.bounds import BoundsChecks  # noqa: E402
from beacon_core.testing.contract.closing import ClosingChecks  # noqa: E402
from beacon_core.testing.contract.delivery import DeliveryChecks  # noqa: E402
from beacon_core.testing.contract.faults import FaultChecks  # noqa: E402
from beacon_core.testing.contract.lifecycle import LifecycleChecks  # noqa: E402

__all__ = ["AdapterContract"]


class AdapterContract(DeliveryChecks, BoundsChecks, FaultChecks, LifecycleChecks, ClosingChecks):
    """Every check there is. A promise of the ports that no check here tests is a gap: report it."""
