from __future__ import annotations

import threading

import pytest

from beacon_core.ports.conduit import Conduit, FrameSink
from beacon_core.testing.relay.conduit_harness import (
    ConduitCapabilities,
    End,
    RealTimeConduitHarness,
    Recorder,
)
from beacon_fake.cable import FakeCable


def test_a_recorder_writes_down_what_came_in_and_what_was_told() -> None:
    recorder = Recorder()
    assert not recorder.up
    recorder.link(up=True)
    recorder.frame(b"h", b"p")
    assert recorder.up
    recorder.link(up=False)
    assert not recorder.up
    assert recorder.frames == [(b"h", b"p")]
    assert [up for up, _ in recorder.links] == [True, False]
    assert recorder.links[0][1] <= recorder.links[1][1]


def test_calls_within_each_other_in_one_thread_do_not_overlap() -> None:
    recorder = Recorder()

    def once() -> None:
        recorder.hook = None
        recorder.frame(b"inner", b"")

    recorder.hook = once
    recorder.frame(b"outer", b"")
    assert len(recorder.frames) == 2
    assert not recorder.overlapped


def test_two_threads_at_once_are_noticed() -> None:
    recorder = Recorder()

    def meanwhile() -> None:
        recorder.hook = None
        other = threading.Thread(target=recorder.link, kwargs={"up": True})
        other.start()
        other.join()

    recorder.hook = meanwhile
    recorder.frame(b"h", b"")
    assert recorder.overlapped


def test_an_end_knows_what_it_has_heard() -> None:
    cable = FakeCable()
    one, other = (End(cable.end()).start() for _ in range(2))
    one.conduit.send(b"h", b"p")
    assert not other.heard((b"h", b"p"))
    cable.deliver()
    assert other.heard((b"h", b"p"))


def test_a_real_harness_waits_until_it_happens_or_it_is_too_late() -> None:
    harness = RealTimeConduitHarness()
    left = iter([False, False, True])
    assert harness.wait_until(lambda: next(left), 10.0)
    assert not harness.wait_until(lambda: False, 0.01)
    assert harness.wait_until(lambda: True, 0.0)
    harness.close()


def test_a_real_harness_does_nothing_to_its_carrier_unless_it_says_how() -> None:
    harness = RealTimeConduitHarness()
    assert harness.capabilities == ConduitCapabilities(breaks=False, freezes=False)
    for what in (harness.cut, harness.mend, harness.frozen):
        with pytest.raises(NotImplementedError):
            what()


def test_an_end_is_made_of_any_conduit() -> None:
    class Nothing:
        def start(self, sink: FrameSink) -> None:
            sink.link(up=True)

        send = limits = close = None

    conduit: Conduit = Nothing()  # type: ignore[assignment]
    assert End(conduit).start().sink.up
