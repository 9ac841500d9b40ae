"""Closing: once, twice, early, late, from anywhere; and silence ever after."""

from __future__ import annotations

import pytest

from beacon_core.errors import UsageError
from beacon_core.testing.contract.base import ContractBase, hint
from beacon_core.testing.harness import CLOSE_WITHIN_S, Harness, Listener, within

__all__ = ["ClosingChecks"]


class ClosingChecks(ContractBase):
    """What ``close`` promises, of sources and of announcers."""

    def test_nothing_is_heard_after_close(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine"))
        self.active(harness, listener, "engine")
        within(CLOSE_WITHIN_S, listener.source.close)
        heard = len(listener.tap.calls)
        announcer.announce(hint("engine", "again"))
        self.quiet(harness, lambda: len(listener.tap.calls) > heard, "a call after close")

    def test_announcing_after_close_is_a_mistake_of_the_caller(self, harness: Harness) -> None:
        announcer = harness.announcer()
        within(CLOSE_WITHIN_S, announcer.close)
        with pytest.raises(UsageError):
            announcer.announce(hint("engine"))
