"""What must not matter: hostile bytes, floods, crashes, rivals, strangers."""

from __future__ import annotations

import pytest

from beacon_core.outcome import Verdict
from beacon_core.testing.contract.base import ContractBase, hint
from beacon_core.testing.harness import Harness, Listener

__all__ = ["FaultChecks"]

HOSTILE_PAYLOADS = {
    "nothing": b"",
    "a-nul": b"\0",
    "noise": bytes(range(256)) * 4,
}


class FaultChecks(ContractBase):
    """The network and everybody on it at their worst."""

    @pytest.mark.parametrize("kind", HOSTILE_PAYLOADS)
    def test_a_hostile_payload_is_refused_and_harms_nobody(
        self, harness: Harness, kind: str
    ) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        harness.send_raw("hostile", HOSTILE_PAYLOADS[kind])
        self.eventually(
            harness, lambda: listener.count(Verdict.MALFORMED) >= 1, "the payload is refused"
        )
        harness.announcer().announce(hint("engine"))
        self.active(harness, listener, "engine")
        assert listener.status("hostile") is None

    def test_two_networks_do_not_hear_each_other(self, harness: Harness) -> None:
        here, there = Listener(harness).start(), Listener(harness, network=1).start()
        harness.announcer().announce(hint("here"))
        harness.announcer(network=1).announce(hint("there"))
        self.active(harness, here, "here")
        self.active(harness, there, "there")
        self.quiet(
            harness,
            lambda: here.status("there") is not None or there.status("here") is not None,
            "a hint of the other network",
        )
