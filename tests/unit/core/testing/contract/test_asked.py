"""The suite also suits carriers whose sources ask: nothing is heard but what is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import attrs
import pytest

from beacon_core.ports.announcer import Announcer
from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.harness import Capabilities, Harness
from beacon_fake import FakeAnnouncer, FakeNetwork, Kind, Message
from beacon_fake.harness import FakeHarness

Run = Callable[..., None]

_INTERVAL_S = 2.0


class Asked(FakeAnnouncer):
    """Whatever its period, it is heard once each interval, unless it does not answer."""

    def __init__(
        self, network: FakeNetwork, name: str = "", *, period_s: float | None = None
    ) -> None:
        super().__init__(network, name, period_s=_INTERVAL_S)
        self.answers = True

    def _hint(self, entity_id: str, payload: bytes) -> Message:
        message = super()._hint(entity_id, payload)
        return message if self.answers else attrs.evolve(message, kind=Kind.GOODBYE, entity_id="")


class AskedHarness(FakeHarness):
    """Silence is to be kept, or not: then the checks must notice."""

    capabilities = Capabilities(pushes=False, every_word=False)

    def __init__(self) -> None:
        super().__init__(announcer=Asked)

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:
        return _silenced(announcer)


class ChattyHarness(AskedHarness):
    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:
        return FakeHarness.silenced(self, announcer)


@contextmanager
def _silenced(announcer: Announcer) -> Iterator[None]:
    assert isinstance(announcer, Asked)
    announcer.answers = False
    yield
    announcer.answers = True


class TestAsked(AdapterContract):
    def make_harness(self) -> Harness:
        return AskedHarness()


@pytest.mark.parametrize(
    "check",
    [
        "who_falls_silent_becomes_stale",
        "who_stays_silent_is_gone",
        "who_speaks_again_is_active_again",
        "a_source_that_starts_late_sees_what_was_said_long_ago",
    ],
)
def test_who_does_not_fall_silent_when_it_must_is_noticed(run: Run, check: str) -> None:
    with pytest.raises(AssertionError):
        run(f"test_{check}", ChattyHarness())


def test_a_carrier_that_is_said_to_push_must_not_be_asked(run: Run) -> None:
    harness = AskedHarness()
    harness.capabilities = Capabilities(every_word=False)
    with pytest.raises(AssertionError):
        run("test_an_announcer_without_a_period_speaks_only_when_told", harness)


@pytest.mark.parametrize("capability", ["nul_in_text", "every_word"])
def test_what_a_carrier_cannot_do_is_not_asked_of_it(run: Run, capability: str) -> None:
    checks: dict[str, tuple[str, dict[str, Any]]] = {
        "nul_in_text": ("text_of_any_script_arrives_intact", {"script": "nul-inside"}),
        "every_word": ("what_one_announcer_says_arrives_in_the_order_said", {}),
    }
    check, parameters = checks[capability]
    harness = FakeHarness()
    harness.capabilities = Capabilities(**{capability: False})
    with pytest.raises(pytest.skip.Exception, match=capability):
        run(f"test_{check}", harness, **parameters)
