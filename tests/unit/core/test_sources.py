"""Accounts of sources: bounded, and nothing counted is ever lost."""

from __future__ import annotations

import pytest

from beacon_core import sources as module
from beacon_core.limits import MAX_SOURCE_NAME
from beacon_core.outcome import Verdict
from beacon_core.skew import ClockOffset
from beacon_core.sources import Sources


def test_a_source_is_met_once_and_found_afterwards() -> None:
    sources = Sources()
    assert sources.find("r1") is None
    met = sources.meet("r1")
    assert sources.find("r1") is met
    assert sources.meet("r1") is met


def test_names_beyond_the_limit_share_an_account() -> None:
    sources = Sources()
    long = "x" * MAX_SOURCE_NAME
    assert sources.meet(long + "a") is sources.meet(long + "b")
    assert [source.name for source in sources.all()[0]] == [long]


def test_a_report_says_what_was_counted() -> None:
    sources = Sources()
    source = sources.meet("r1")
    source.counts[Verdict.NEW] += 1
    source.refreshed = 4
    source.repaired = 2
    source.distrusted = 3
    source.clock = ClockOffset()
    source.clock.observe(stamp_ns=0, wall_now_ns=7)
    report = source.report()
    assert report.counts == {Verdict.NEW: 1, Verdict.REFRESHED: 4}
    assert (report.repaired, report.distrusted_stamps, report.clock_offset_ns) == (2, 3, 7)


def test_refreshes_by_the_short_and_by_the_long_way_are_one_count() -> None:
    source = Sources().meet("r1")
    source.refreshed = 4
    source.counts[Verdict.REFRESHED] = 2
    assert source.all_counts() == {Verdict.REFRESHED: 6}


def test_a_source_without_stamps_has_no_offset() -> None:
    sources = Sources()
    assert sources.meet("r1").report().clock_offset_ns is None


def test_what_was_folded_away_stays_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "MAX_SOURCES", 20)
    sources = Sources()
    for number in range(50):
        source = sources.meet(f"r{number}")
        source.counts[Verdict.INVALID] += 1
        source.refreshed += 2
    assert len(sources) <= 20
    living, total = sources.all()
    for source in living:
        total.update(source.all_counts())
    assert total == {Verdict.INVALID: 50, Verdict.REFRESHED: 100}


def test_strangers_give_way_before_settled_sources_and_the_longest_silent_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "MAX_SOURCES", 20)
    sources = Sources()
    for number in range(20):
        source = sources.meet(f"r{number}")
        source.settled = number < 10
        source.busy_until_ns = 100 - number
    sources.meet("newcomer")
    names = {source.name for source in sources.all()[0]}
    assert names == {"newcomer", *(f"r{number}" for number in range(18))}
