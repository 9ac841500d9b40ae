"""The snapshot file: what a gateway knew is there after a restart, with the doubt it deserves."""

from __future__ import annotations

import json
import logging
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.store import HintStore
from beacon_core.testing.strategies import hints
from beacon_gateway import snapshot as module
from beacon_gateway.config import SourceConfig, parse_config
from beacon_gateway.snapshot import SnapshotConfig, SnapshotFile, Snapshots

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import PlantMaker

S = 10**9


@attrs.frozen
class Desk:
    """A clock, stores on it, and the file."""

    clock: ManualClock
    path: Path

    def file(self) -> SnapshotFile:
        return SnapshotFile(self.path, self.clock)

    def store(self, **config: Any) -> HintStore:
        return HintStore(self.clock, **config)

    def restored(self, **config: Any) -> HintStore:
        store = self.store(**config)
        self.file().restore({"robots": store})
        return store


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(ManualClock(), tmp_path / "snapshot.jsonl")


def known(store: HintStore, entity_id: str = "lidar") -> Any:
    stored = store.get(entity_id)
    assert stored is not None
    return stored


def test_what_was_known_is_known_again_as_stale_and_as_old_as_it_is(desk: Desk) -> None:
    store = desk.store()
    hint = BeaconHint("lidar", display_name="Laser", depends_on=("base",), metadata={"a": "b"})
    store.update(hint, source="r", incarnation="i")
    desk.clock.advance(4 * S)
    assert desk.file().write({"robots": store}) == 1
    desk.clock.advance(3 * S)
    stored = known(desk.restored())
    assert stored.hint == hint
    assert stored.status is Status.STALE
    assert stored.age_ns(desk.clock.monotonic_ns()) == 7 * S
    assert (stored.source, stored.incarnation) == ("r", "i")


def test_what_has_expired_meanwhile_is_not_brought_back(desk: Desk) -> None:
    store = desk.store()
    store.update(BeaconHint("lidar"))
    desk.file().write({"robots": store})
    desk.clock.advance(300 * S)
    assert desk.restored().size() == 0


def test_who_left_is_not_brought_back(desk: Desk) -> None:
    store = desk.store()
    store.update(BeaconHint("lidar"), source="r")
    store.goodbye("lidar", source="r")
    desk.file().write({"robots": store})
    assert desk.restored().size() == 0


def test_each_store_gets_its_own_and_one_that_is_gone_nothing(desk: Desk) -> None:
    robots, plant = desk.store(), desk.store()
    robots.update(BeaconHint("a"))
    plant.update(BeaconHint("b"))
    desk.file().write({"robots": robots, "plant": plant})
    store = desk.restored()
    assert [one.entity_id for one in store.snapshot()] == ["a"]


def test_a_fuller_file_than_the_store_keeps_the_latest(desk: Desk) -> None:
    store = desk.store()
    for number in range(5):
        store.update(BeaconHint(f"e{number}"))
        desk.clock.advance(S)
    desk.file().write({"robots": store})
    small = desk.restored(max_hints=2)
    assert {one.entity_id for one in small.snapshot()} == {"e3", "e4"}


def test_a_clock_that_was_set_back_makes_nothing_younger(desk: Desk) -> None:
    store = desk.store()
    store.update(BeaconHint("lidar"))
    desk.clock.advance(5 * S)
    desk.file().write({"robots": store})
    lines = desk.path.read_text().splitlines()
    head = json.loads(lines[0])
    head["written_at_ns"] += 10**15
    desk.path.write_text("\n".join([json.dumps(head), *lines[1:]]) + "\n")
    assert known(desk.restored()).age_ns(desk.clock.monotonic_ns()) == 5 * S


def test_no_file_is_no_news(desk: Desk, caplog: pytest.LogCaptureFixture) -> None:
    assert desk.restored().size() == 0
    assert caplog.text == ""


@given(said=st.lists(hints(), max_size=8, unique_by=lambda one: one.entity_id))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_every_valid_hint_comes_back_as_it_was(desk: Desk, said: list[BeaconHint]) -> None:
    store = desk.store()
    for hint in said:
        store.update(hint)
    desk.file().write({"robots": store})
    found = desk.restored()
    assert {one.hint for one in map(_plain, found.snapshot())} == {
        one.hint for one in map(_plain, store.snapshot())
    }


@attrs.frozen
class _Plain:
    hint: str


def _plain(stored: Any) -> _Plain:
    return _Plain(repr(attrs.asdict(stored.hint)))


HEAD = {"format": "beacon-snapshot", "version": 1, "written_at_ns": 0}
LINE = {
    "store": "robots",
    "hint": {"entity_id": "lidar"},
    "age_ns": 0,
    "source": "",
    "incarnation": "",
    "restarts": 0,
}


def text(*lines: object) -> bytes:
    return b"".join(json.dumps(line).encode() + b"\n" for line in lines)


DAMAGED = {
    "empty": b"",
    "no JSON": b"\x00\xff" * 100,
    "somebody else's": b'{"name": "package", "version": "1.0.0"}\n',
    "a list": b"[]\n",
    "a number": b"7\n",
    "a later version": text({**HEAD, "version": 2}, {"end": 0}),
    "no time": text({"format": "beacon-snapshot", "version": 1}, {"end": 0}),
    "cut off": text(HEAD, LINE),
    "cut off in a line": text(HEAD, LINE)[:-10],
    "a wrong end": text(HEAD, LINE, {"end": 2}),
    "more after the end": text(HEAD, LINE, {"end": 1}, LINE),
    "no hint": text(HEAD, {**LINE, "hint": {}}, {"end": 1}),
    "a bad id": text(HEAD, {**LINE, "hint": {"entity_id": "a b"}}, {"end": 1}),
    "an unknown field": text(HEAD, {**LINE, "hint": {"entity_id": "a", "x": 1}}, {"end": 1}),
    "from the future": text(HEAD, {**LINE, "age_ns": -1}, {"end": 1}),
    "a list as a hint": text(HEAD, [1], {"end": 1}),
    "nested": text(HEAD) + b"[" * 100_000 + b"\n",
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_or_foreign_file_is_set_aside_and_said(
    desk: Desk, content: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    desk.path.write_bytes(content)
    assert desk.restored().size() == 0
    assert not desk.path.exists()
    assert desk.path.with_name("snapshot.jsonl.damaged").read_bytes() == content
    (record,) = caplog.records
    assert "set aside as snapshot.jsonl.damaged" in record.getMessage()
    assert "\n" not in record.getMessage()


def test_what_these_lines_say_is_a_good_file(desk: Desk) -> None:
    desk.path.write_bytes(text({**HEAD, "written_at_ns": 2**62}, LINE, {"end": 1}))
    assert known(desk.restored()).status is Status.STALE


@given(st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_whatever_happens_to_a_byte_nothing_is_raised(desk: Desk, data: st.DataObject) -> None:
    whole = text(HEAD, LINE, {"end": 1})
    place = data.draw(st.integers(0, len(whole) - 1))
    desk.path.write_bytes(
        whole[:place] + bytes([data.draw(st.integers(0, 255))]) + whole[place + 1 :]
    )
    desk.restored()
    desk.path.write_bytes(whole[:place])
    assert desk.restored().size() == 0


def test_a_line_without_end_is_not_read_whole(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "_MAX_LINE", 100)
    desk.path.write_bytes(b"x" * 1000)
    desk.restored()
    assert "a line without an end" in caplog.text


def test_a_file_that_cannot_be_read_or_set_aside_is_said(
    desk: Desk, caplog: pytest.LogCaptureFixture
) -> None:
    desk.path.mkdir()
    assert desk.restored().size() == 0
    assert "cannot be read: Is a directory" in caplog.text
    desk.path.rmdir()
    desk.path.write_text("no snapshot")
    aside = desk.path.with_name("snapshot.jsonl.damaged")
    aside.mkdir()
    desk.restored()
    assert "and stays: Is a directory" in caplog.text


def test_the_file_is_replaced_whole_and_is_for_its_owner_only(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = desk.store()
    store.update(BeaconHint("lidar"))
    desk.file().write({"robots": store})
    before = desk.path.read_bytes()
    assert stat.S_IMODE(desk.path.stat().st_mode) == 0o600
    store.update(BeaconHint("camera"))

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        desk.file().write({"robots": store})
    assert desk.path.read_bytes() == before


def eventually(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10
    while not true():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.01)


def test_it_is_written_now_and_then_and_at_the_end(desk: Desk) -> None:
    store = desk.store()
    keeper = Snapshots(SnapshotConfig(desk.path, 0.02), {"robots": store}, desk.clock)
    keeper.start()
    store.update(BeaconHint("a"))
    eventually(lambda: desk.path.exists() and b'"a"' in desk.path.read_bytes())
    keeper.close(5)
    slow = Snapshots(SnapshotConfig(desk.path, 1000), {"robots": store}, desk.clock)
    slow.start()
    store.update(BeaconHint("b"))
    slow.close(5)
    slow.close(5)
    assert b'"b"' in desk.path.read_bytes()


def test_a_full_disk_is_said_once_and_tried_again(
    desk: Desk, caplog: pytest.LogCaptureFixture
) -> None:
    path = desk.path.parent / "missing" / "snapshot"
    store = desk.store()
    keeper = Snapshots(SnapshotConfig(path, 0.01), {"robots": store}, desk.clock)
    keeper.start()
    eventually(lambda: "cannot be written" in caplog.text)
    path.parent.mkdir()
    eventually(path.exists)
    keeper.close(5)
    assert caplog.text.count("cannot be written: No such file") == 1


def test_a_restarted_gateway_shows_the_last_known_until_they_are_heard(
    make_plant: PlantMaker, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    path = tmp_path / "snapshot.jsonl"
    first = make_plant(snapshot={"path": str(path), "every_s": 1000})
    first.announce("lidar", display_name="Laser")
    first.announce("camera")
    first.gateway.close()
    second = make_plant(snapshot={"path": str(path)})
    assert "2 hints known from before" in caplog.text
    body = second.ok("/apps/lidar/x-medkit-beacon")
    assert (body["status"], body["display_name"]) == ("stale", "Laser")
    assert body["reason"] == "known from before a restart, and not heard since"
    second.announce("lidar")
    assert second.ok("/apps/lidar/x-medkit-beacon")["status"] == "active"
    assert second.ok("/apps/camera/x-medkit-beacon")["status"] == "stale"


def test_the_path_begins_where_the_configuration_is(tmp_path: Path) -> None:
    given_ = {"sources": {"a": {"adapter": "fake"}}, "snapshot": {"path": "state/s", "every_s": 0}}
    loaded = parse_config(given_, folder=tmp_path)
    assert loaded.config.snapshot == SnapshotConfig(tmp_path / "state/s", 1.0)
    assert isinstance(loaded.config.sources["a"], SourceConfig)
