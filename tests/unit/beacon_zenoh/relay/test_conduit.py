"""What is particular to the conduit over Zenoh; the promises of the port are in tests/contract."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import attrs
import pytest

from beacon_core.errors import ConfigError, UsageError
from beacon_core.relay.frames import Reset, content_header, encode
from beacon_core.testing.harness import within
from beacon_core.testing.relay.conduit_harness import End
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.relay.conduit import DEFAULTS, ZenohConduit
from beacon_zenoh.relay.harness import ProcessEnd, ZenohConduitHarness
from beacon_zenoh.relay.options import MAX_HEADER_BYTES, RelayOptions

CONTENT = content_header(7, 1, 1, 0, 0, 7, 0)
RESET, _ = encode(Reset(0, 0, 9, hello=1))


def wait_for(what: Callable[[], bool], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline, "it takes too long"
        time.sleep(0.002)


@pytest.fixture
def harness() -> Iterator[ZenohConduitHarness]:
    harness = ZenohConduitHarness()
    yield harness
    harness.close()


def linked(harness: ZenohConduitHarness, count: int = 2) -> list[End]:
    ends = [End(harness.conduit()).start() for _ in range(count)]
    wait_for(lambda: all(end.sink.up for end in ends))
    return ends


def inner(end: End) -> ZenohConduit:
    assert isinstance(end.conduit, ZenohConduit)
    return end.conduit


def goes_by_itself(end: End) -> bool:
    """Does a small frame go without the outbox? Not while the last one there took its time, as a
    busy machine may make it; then this one lets the next go."""
    outbox = inner(end)._outbox
    behind = outbox.busy
    assert end.conduit.send(b"small", b"")
    return not (behind or outbox.busy)


def test_forwarders_are_not_sent_what_others_tell(harness: ZenohConduitHarness) -> None:
    base, one, other = linked(harness, 3)
    base.conduit.send(RESET, b"")
    wait_for(lambda: one.heard((RESET, b"")) and other.heard((RESET, b"")))
    for end in (one, other):
        end.conduit.send(CONTENT, b"before")
    wait_for(lambda: not inner(one)._hearing and not inner(other)._hearing)
    assert inner(base)._hearing
    known = len(one.sink.frames)
    for size in (10, 100_000):
        other.conduit.send(CONTENT, bytes(size))
        wait_for(lambda size=size: base.heard((CONTENT, bytes(size))))  # type: ignore[misc]
    base.conduit.send(RESET, b"again")
    wait_for(lambda: one.heard((RESET, b"again")))
    # What was said to both before may have been on its way.
    heard = [frame for frame in one.sink.frames[known:] if frame != (CONTENT, b"before")]
    assert heard == [(RESET, b"again")]


def test_a_forwarder_that_asks_too_hears_what_others_tell(harness: ZenohConduitHarness) -> None:
    one, other = linked(harness)
    one.conduit.send(CONTENT, b"")
    wait_for(lambda: not inner(one)._hearing)
    one.conduit.send(RESET, b"")
    wait_for(lambda: len(inner(one)._hearing) == 2)

    def heard() -> bool:
        other.conduit.send(CONTENT, b"hello")
        return one.heard((CONTENT, b"hello"))

    wait_for(heard)


def test_other_links_and_other_prefixes_are_not_heard() -> None:
    endpoint = free_endpoint()
    here = RelayOptions(listen=(endpoint,))
    there = RelayOptions(connect=(endpoint,))
    one, same, link, prefix = (
        End(ZenohConduit(options)).start()
        for options in (
            here,
            there,
            attrs.evolve(there, link="another"),
            attrs.evolve(there, prefix="another"),
        )
    )
    wait_for(lambda: one.sink.up and same.sink.up)
    assert one.conduit.send(b"header", b"payload")
    wait_for(lambda: same.heard((b"header", b"payload")))
    assert not link.sink.up
    assert not prefix.sink.up
    for end in (one, same, link, prefix):
        end.conduit.close()


def test_a_large_frame_does_not_wait_in_the_thread_of_who_sends_it(
    harness: ZenohConduitHarness,
) -> None:
    one, other = linked(harness)
    outbox = inner(one)._outbox
    payload = bytes(1024 * 1024)
    for number in range(3):
        assert one.conduit.send(b"%d" % number, payload)
    assert outbox._thread is not None
    wait_for(lambda: len(other.sink.frames) == 3)
    wait_for(lambda: goes_by_itself(one))


def test_behind_a_slow_frame_the_others_wait_in_the_outbox_in_order(
    harness: ZenohConduitHarness, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = linked(harness)
    monkeypatch.setattr("beacon_zenoh.relay.conduit._SLOW_S", -1.0)
    for number in range(20):
        assert one.conduit.send(b"%d" % number, b"")
    outbox = inner(one)._outbox
    assert outbox._thread is not None
    wait_for(lambda: len(other.sink.frames) == 20)
    assert other.sink.frames == [(b"%d" % number, b"") for number in range(20)]
    assert outbox.busy
    monkeypatch.undo()
    wait_for(lambda: goes_by_itself(one))


def test_a_sink_that_raises_is_logged_and_hears_the_next_one(
    harness: ZenohConduitHarness, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        other.sink.hook = None
        raise RuntimeError("a defect")

    def fail_on_link(*, up: bool) -> None:
        raise RuntimeError("another defect")

    one, other = linked(harness)
    other.sink.hook = fail
    one.conduit.send(b"first", b"")
    one.conduit.send(b"second", b"")
    wait_for(lambda: other.heard((b"second", b"")))
    other.sink.link = fail_on_link  # type: ignore[method-assign]
    one.conduit.close()
    wait_for(lambda: len(caplog.records) >= 2)
    assert {record.getMessage() for record in caplog.records} == {"the sink raised"}


def test_a_place_where_it_cannot_listen_is_the_callers_mistake(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("beacon_zenoh.session._FIRST_ATTEMPT_S", 30.0)
    taken = RelayOptions(listen=("tcp/192.0.2.1:7447",))
    with pytest.raises(ConfigError, match="listen"):
        End(ZenohConduit(taken)).start()


def test_an_end_starts_once(harness: ZenohConduitHarness) -> None:
    one, _ = linked(harness)
    with pytest.raises(UsageError):
        one.start()


def test_who_listens_is_a_router_and_others_are_clients_unless_told_otherwise() -> None:
    def config(options: RelayOptions) -> str:
        return ZenohConduit(options)._keeper.config.mode

    assert config(RelayOptions()) == "client"
    assert config(RelayOptions(listen=("tcp/127.0.0.1:1",))) == "router"
    assert config(RelayOptions(mode="peer", listen=("tcp/127.0.0.1:1",))) == "peer"


def test_shared_memory_is_off_and_the_lease_below_two_seconds_unless_told_otherwise(
    tmp_path: Path,
) -> None:
    def transport(options: RelayOptions) -> tuple[object, object]:
        found = ZenohConduit(options)._keeper.config.document["transport"]
        return found["shared_memory"]["enabled"], found["link"]["tx"]["lease"]

    lease = {"transport": {"link": {"tx": {"lease": 9000}}}}
    assert transport(RelayOptions()) == (False, 1500)
    assert DEFAULTS["transport"]["link"]["tx"]["lease"] == 1500
    assert transport(RelayOptions(config=lease)) == (False, 9000)
    file = tmp_path / "zenoh.json5"
    file.write_text("{transport: {link: {tx: {lease: 8000}}}}")
    assert transport(RelayOptions(config_file=str(file))) == (False, 8000)


def test_the_largest_frame_fits_into_the_cap() -> None:
    limits = ZenohConduit(RelayOptions(send_bytes=10**6)).limits()
    assert limits.max_header_bytes == MAX_HEADER_BYTES
    assert limits.max_header_bytes + limits.max_payload_bytes == 10**6


def test_an_end_whose_process_is_killed_is_told_at_once(harness: ZenohConduitHarness) -> None:
    one = End(harness.conduit()).start()
    other = ProcessEnd(harness._client())
    other.linked()
    wait_for(lambda: one.sink.up)
    killed_at = time.monotonic()
    other.end()
    wait_for(lambda: not one.sink.up)
    assert one.sink.links[-1][1] - killed_at < 1.0


def test_a_session_that_is_found_closed_is_told_and_replaced(
    harness: ZenohConduitHarness,
) -> None:
    _, other = linked(harness)
    session = inner(other)._keeper._session
    assert session is not None
    session.close()
    inner(other)._keeper.wake()
    assert other.conduit.send(b"header", b"") is False
    wait_for(lambda: [up for up, _ in other.sink.links] == [True, False, True])


def test_a_sink_that_hangs_does_not_hang_close(harness: ZenohConduitHarness) -> None:
    one, other = linked(harness)
    inside, go = threading.Event(), threading.Event()

    def hang() -> None:
        inside.set()
        go.wait(10)

    other.sink.hook = hang
    one.conduit.send(b"header", b"")
    assert inside.wait(5)
    try:
        within(1.0, other.conduit.close)
    finally:
        go.set()


ENDS_WITHOUT_CLOSE = """
import sys, time
from beacon_core.testing.relay.conduit_harness import End
from beacon_zenoh.relay.conduit import ZenohConduit
from beacon_zenoh.relay.options import RelayOptions
end = End(ZenohConduit(RelayOptions(connect=(sys.argv[1],)))).start()
deadline = time.monotonic() + 10
while not end.sink.up and time.monotonic() < deadline:
    time.sleep(0.01)
for number in range(50):
    end.conduit.send(b"%d" % number, bytes(500_000))
"""


def test_a_process_that_forgets_to_close_ends_all_the_same() -> None:
    endpoint = free_endpoint()
    one = End(ZenohConduit(RelayOptions(listen=(endpoint,)))).start()
    command = [sys.executable, "-c", ENDS_WITHOUT_CLOSE, endpoint]
    assert subprocess.run(command, check=False, timeout=20).returncode == 0
    one.conduit.close()


def test_in_a_child_of_its_process_it_closes_without_waiting(
    harness: ZenohConduitHarness,
) -> None:
    one, _ = linked(harness)
    keeper = inner(one)._keeper
    keeper._pid, pid = -1, keeper._pid
    inner(one).close()
    keeper._pid = pid
    assert one.conduit.send(b"header", b"")
