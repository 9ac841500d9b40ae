"""The fake's harness waits in virtual time, and its networks do not hear each other."""

from __future__ import annotations

import time

from beacon_core.hint import BeaconHint
from beacon_core.testing.harness import Listener
from beacon_fake import Link
from beacon_fake.harness import FakeHarness

SECOND_NS = 1_000_000_000


def test_waiting_takes_virtual_time_only() -> None:
    harness = FakeHarness()
    begin_ns, real = harness.clock.monotonic_ns(), time.monotonic()
    assert not harness.wait_until(lambda: False, 3600.0)
    assert harness.clock.monotonic_ns() == begin_ns + 3600 * SECOND_NS
    assert time.monotonic() - real < 60.0
    harness.close()


def test_waiting_ends_as_soon_as_the_predicate_holds() -> None:
    harness = FakeHarness(link=Link(latency_s=2.0))
    listener = Listener(harness).start()
    harness.announcer().announce(BeaconHint("a"))
    begin_ns = harness.clock.monotonic_ns()
    assert harness.wait_until(lambda: listener.has("a"), 60.0)
    assert harness.clock.monotonic_ns() == begin_ns + 2 * SECOND_NS
    harness.close()


def test_a_crash_is_found_on_whichever_network_it_is() -> None:
    harness = FakeHarness()
    listener = Listener(harness, network=1).start()
    harness.network(0)
    doomed = harness.announcer(network=1)
    doomed.announce(BeaconHint("a"))
    assert harness.wait_until(lambda: listener.has("a"), 1.0)
    harness.crash(doomed)
    harness.crash(doomed)
    assert harness.wait_until(lambda: [c.kind for c in listener.tap.calls][1:] == ["lost"], 1.0)
    harness.close()


def test_raw_payloads_come_from_whom_they_say_and_as_they_are() -> None:
    harness = FakeHarness()
    listener = Listener(harness).start()
    harness.send_raw("a", harness.encode(BeaconHint("a"), 5), sender="somebody")
    assert harness.wait_until(lambda: bool(listener.tap.calls), 1.0)
    call = listener.tap.calls[0]
    assert (call.source, call.incarnation, call.sequence, call.stamp_ns) == ("somebody", "", 0, 0)
    decoded = harness.adapter.decode(call.payload)
    assert getattr(decoded, "stamp_ns", None) == 5
    harness.close()
