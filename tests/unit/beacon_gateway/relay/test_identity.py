"""Who an end is, for ever and in this life."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from beacon_core.clock import ManualClock
from beacon_core.errors import ConfigError
from beacon_gateway.relay.identity import (
    default_state_folder,
    new_asker,
    next_epoch,
    origin_of,
)

S = 10**9


def test_an_origin_stays_and_ends_have_different_ones() -> None:
    assert origin_of("/etc/relay.yaml", "robot") == origin_of("/etc/relay.yaml", "robot")
    others = {origin_of("/etc/relay.yaml", "site"), origin_of("/other.yaml", "robot")}
    assert len({origin_of("/etc/relay.yaml", "robot"), *others}) == 3
    assert all(0 < one < 2**63 for one in others)


def test_each_life_of_a_republisher_has_a_number_of_its_own() -> None:
    assert len({new_asker() for _ in range(100)}) == 100


def test_an_epoch_is_the_wall_clocks_time(tmp_path: Path) -> None:
    clock = ManualClock(wall_ns=5 * S)
    with next_epoch(tmp_path / "new" / "folder", 7, clock) as epoch:
        assert epoch == 5 * S


def test_an_epoch_rises_though_the_clock_was_set_back(tmp_path: Path) -> None:
    with next_epoch(tmp_path, 7, ManualClock(wall_ns=50 * S)) as first:
        pass
    with next_epoch(tmp_path, 7, ManualClock(wall_ns=5 * S)) as second:
        pass
    with next_epoch(tmp_path, 7, ManualClock(wall_ns=5 * S)) as third:
        pass
    assert (second, third) == (first + 1, first + 2)


def test_a_damaged_file_is_as_good_as_none(tmp_path: Path) -> None:
    (tmp_path / f"{7:016x}.epoch").write_bytes(b"\xff not a number")
    with next_epoch(tmp_path, 7, ManualClock(wall_ns=5 * S)) as epoch:
        assert epoch == 5 * S


def test_nobody_lives_twice_at_a_time(tmp_path: Path) -> None:
    clock = ManualClock(wall_ns=5 * S)
    with (
        next_epoch(tmp_path, 7, clock),
        next_epoch(tmp_path, 8, clock),
        pytest.raises(ConfigError, match="0x7 is in use by another process"),
        next_epoch(tmp_path, 7, clock),
    ):
        pass
    with next_epoch(tmp_path, 7, clock) as epoch:
        assert epoch == 5 * S + 1


def test_where_nothing_can_be_written_the_clock_alone_must_do(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("")
    with (
        caplog.at_level(logging.WARNING),
        next_epoch(tmp_path / "file" / "folder", 7, ManualClock(wall_ns=5 * S)) as epoch,
    ):
        assert epoch == 5 * S
    assert "cannot be written" in caplog.text


def test_its_state_lies_where_programs_of_this_user_keep_theirs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/var/state")
    assert default_state_folder() == Path("/var/state/beacon/relay")
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert default_state_folder() == Path("/home/somebody/.local/state/beacon/relay")
