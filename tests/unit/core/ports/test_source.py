"""The source's port: small enough to write one down, and checked to be one by mypy."""

from __future__ import annotations

import inspect

from beacon_core.outcome import Outcome, Verdict
from beacon_core.ports import source
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_core.ports.source import HintSource


class Whisper:
    """Hears one thing, at once."""

    def __init__(self) -> None:
        self.condition = Condition.STARTING

    def start(self, sink: HintSink) -> None:
        self.condition = Condition.UP
        sink.offer(b"a", "whisper")

    def close(self) -> None:
        self.condition = Condition.CLOSED

    def health(self) -> Health:
        return Health(self.condition)


class Ear:
    """Remembers the payloads."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []

    def offer(
        self,
        payload: bytes,
        source: str,
        *,
        entity_id: str = "",
        stamp_ns: int = 0,
        incarnation: str = "",
        sequence: int = 0,
    ) -> Outcome:
        self.heard.append(payload)
        return Outcome(Verdict.NEW)

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        return Outcome(Verdict.UNKNOWN)

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = ""
    ) -> Outcome:
        return Outcome(Verdict.UNKNOWN)


def test_three_methods_make_a_source() -> None:
    port: HintSource = Whisper()
    ear = Ear()
    conditions = [port.health().condition]
    port.start(ear)
    conditions.append(port.health().condition)
    port.close()
    conditions.append(port.health().condition)
    assert ear.heard == [b"a"]
    assert conditions == [Condition.STARTING, Condition.UP, Condition.CLOSED]


def test_the_port_says_its_thread_rule_and_what_it_promises_about_order() -> None:
    text = inspect.getdoc(source.HintSource) or ""
    assert "Thread rule" in text
    assert "order" in text
