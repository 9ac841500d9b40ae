"""What all checks share: skipping by capability, patience, canonical results."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import pytest

from beacon_core.lifecycle import Status
from beacon_core.testing.contract.base import ContractBase, hint, known
from beacon_core.testing.harness import Capabilities, Harness, Listener
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]


class TestBase(ContractBase):
    def make_harness(self) -> Harness:
        return FakeHarness()

    def test_the_check_knows_its_name_and_parameters(self, harness: Harness) -> None:
        assert self.check == "test_the_check_knows_its_name_and_parameters"

    def test_waiting_for_what_comes_ends_when_it_is_there(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        announcer = harness.announcer()
        announcer.announce(hint("engine", "name"))
        self.active(harness, listener, "engine")
        self.named(harness, listener, "engine", "name")
        assert known(listener, "engine").entity_id == "engine"
        announcer.close()
        self.reaches(harness, listener, "engine", Status.LEFT)

    def test_waiting_for_what_does_not_come_fails_and_says_for_what(self, harness: Harness) -> None:
        listener = Listener(harness).start()
        with pytest.raises(AssertionError, match="engine is active"):
            self.active(harness, listener, "engine")
        with pytest.raises(AssertionError, match="engine is called 'x'"):
            self.named(harness, listener, "engine", "x")
        with pytest.raises(AssertionError, match="engine is not in the store"):
            known(listener, "engine")

    def test_what_must_not_happen_fails_when_it_does(self, harness: Harness) -> None:
        self.never(harness, lambda: False, "nothing")
        with pytest.raises(AssertionError, match="must not happen: something"):
            self.never(harness, lambda: True, "something")

    def test_a_result_that_is_not_the_kept_one_fails(self, harness: Harness) -> None:
        with pytest.raises(AssertionError, match="not the canonical result of test_a_result"):
            self.conclude(harness, Listener(harness))

    def test_a_sink_that_raised_fails(self, harness: Harness) -> None:
        listener = Listener(harness)
        listener.tap.failures.append(RuntimeError("broken"))
        with pytest.raises(AssertionError, match="broken"):
            self.conclude(harness, listener)


def test_a_subclass_must_give_a_harness() -> None:
    with pytest.raises(NotImplementedError):
        ContractBase().make_harness()


def test_results_can_be_recorded_instead_of_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    recorded: dict[str, Any] = {}
    monkeypatch.setattr(ContractBase, "recorded", recorded)
    harness, suite = FakeHarness(), ContractBase()
    suite.check = "some check"
    listener = Listener(harness).start()
    harness.announcer().announce(hint("engine"))
    suite.conclude(harness, listener)
    harness.close()
    assert recorded == {
        "some check": [{"entities": {"engine": {"status": "active", "cause": "heard"}}}]
    }


@pytest.mark.parametrize("name", [field.name for field in attrs.fields(Capabilities)])
def test_a_check_of_what_the_carrier_cannot_do_is_skipped_with_the_reason(name: str) -> None:
    harness = FakeHarness()
    harness.capabilities = Capabilities(**{name: False})
    with pytest.raises(pytest.skip.Exception, match=f"fake: .* {name}$"):
        ContractBase.needs(harness, "orders", name)
    others = [field.name for field in attrs.fields(Capabilities) if field.name != name]
    ContractBase.needs(harness, *others)
