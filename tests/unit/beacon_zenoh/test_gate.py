"""After it is shut nothing comes through, whoever holds it, and nobody is held up for ever."""

from __future__ import annotations

import threading
import time

from beacon_core.clock import SystemClock
from beacon_core.intake import Intake
from beacon_core.ports.sink import HintSink
from beacon_core.store import HintStore
from beacon_core.wire import json
from beacon_zenoh.gate import Gate


def gate() -> Gate:
    made = Gate()
    made.lead_to(Intake(HintStore(SystemClock()), json.decode))
    return made


def test_it_lets_through_until_it_is_shut() -> None:
    one = gate()
    assert one.let(lambda _: "through") == "through"
    assert one.shut(1.0) >= 0
    assert one.is_shut
    assert one.let(lambda _: "through") is None


def test_one_that_leads_nowhere_lets_nothing_through() -> None:
    assert Gate().let(lambda _: "through") is None


def test_a_sink_that_raises_is_counted() -> None:
    one = gate()

    def raises(_: HintSink) -> None:
        raise RuntimeError("made by this test")

    assert one.let(raises) is None
    assert one.errors == 1
    assert one.let(lambda _: "through") == "through"


def test_from_within_a_call_it_does_not_wait() -> None:
    one, spent = gate(), list[float]()
    one.let(lambda _: spent.append(one.shut(60.0)))
    assert spent == [-1.0]
    assert one.is_shut


def test_a_call_that_hangs_is_not_waited_for_for_ever() -> None:
    one, entered, release = gate(), threading.Event(), threading.Event()

    def hang(_: HintSink) -> None:
        entered.set()
        release.wait(10.0)

    thread = threading.Thread(target=one.let, args=(hang,), daemon=True)
    thread.start()
    assert entered.wait(10.0)
    began = time.monotonic()
    assert one.shut(0.1) >= 0.1
    assert time.monotonic() - began < 5.0
    release.set()
    thread.join(10.0)
