"""The sink's port: small enough to write one down, and checked to be one by mypy."""

from __future__ import annotations

import inspect

from beacon_core.outcome import Outcome, Verdict
from beacon_core.ports import sink
from beacon_core.ports.sink import HintSink


class Drain:
    """Takes everything and keeps nothing."""

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
        return Outcome(Verdict.NEW)

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        return Outcome(Verdict.LEFT, entity_id)

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = "connection lost"
    ) -> Outcome:
        return Outcome(Verdict.LOST, entity_id, detail=reason)


def test_three_methods_make_a_sink() -> None:
    port: HintSink = Drain()
    assert port.offer(b"{}", "robot").verdict is Verdict.NEW
    assert port.goodbye("a", "robot").verdict is Verdict.LEFT
    assert port.lost("a", "robot").detail == "connection lost"


def test_what_a_carrier_does_not_know_it_need_not_say() -> None:
    for method in (HintSink.offer, HintSink.goodbye, HintSink.lost):
        optional = list(inspect.signature(method).parameters.values())[3:]
        assert all(
            one.kind is one.KEYWORD_ONLY and one.default in {0, "", "connection lost"}
            for one in optional
        )


def test_the_port_says_its_thread_rule() -> None:
    assert "Thread rule" in (inspect.getdoc(sink.HintSink) or "")
