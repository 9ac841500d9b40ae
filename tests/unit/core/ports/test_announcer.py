"""The announcer's port: small enough to write one down, and checked to be one by mypy."""

from __future__ import annotations

import inspect

from beacon_core.hint import BeaconHint
from beacon_core.ports import announcer
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.health import Condition, Health


class Megaphone:
    """Remembers what it would have said."""

    def __init__(self) -> None:
        self.said: dict[str, BeaconHint] = {}
        self.condition = Condition.UP

    def announce(self, hint: BeaconHint) -> None:
        self.said[hint.entity_id] = hint

    def withdraw(self, entity_id: str) -> None:
        self.said.pop(entity_id, None)

    def close(self) -> None:
        self.said.clear()
        self.condition = Condition.CLOSED

    def health(self) -> Health:
        return Health(self.condition)


def test_four_methods_make_an_announcer() -> None:
    megaphone = Megaphone()
    port: Announcer = megaphone
    port.announce(BeaconHint("a"))
    port.announce(BeaconHint("b"))
    port.withdraw("a")
    assert list(megaphone.said) == ["b"]
    assert port.health().condition is Condition.UP
    port.close()
    assert not megaphone.said
    assert port.health().condition is Condition.CLOSED


def test_the_port_says_its_thread_rule() -> None:
    assert "Thread rule" in (inspect.getdoc(announcer.Announcer) or "")
