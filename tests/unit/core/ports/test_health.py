"""Health: a condition, a sentence, and counters of one's own."""

from __future__ import annotations

import attrs
import pytest

from beacon_core.ports.health import Condition, Health


def test_the_conditions_are_those_a_person_is_told() -> None:
    assert [str(one) for one in Condition] == ["starting", "up", "degraded", "down", "closed"]


def test_without_more_words_all_is_well_and_nothing_was_counted() -> None:
    health = Health(Condition.UP)
    assert (health.detail, dict(health.counters)) == ("", {})


def test_two_reports_never_share_their_counters() -> None:
    assert Health(Condition.UP).counters is not Health(Condition.UP).counters


def test_a_report_cannot_be_changed() -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        Health(Condition.UP).detail = "all is lost"  # type: ignore[misc]
