"""Verdicts: each message ends in one, and some of them mean that it was taken."""

from __future__ import annotations

import re

import attrs
import pytest

from beacon_core.outcome import ACCEPTED, Outcome, Verdict


def test_the_names_of_verdicts_are_fit_for_counters() -> None:
    assert all(re.fullmatch(r"[a-z]+(-[a-z]+)*", verdict) for verdict in Verdict)


@pytest.mark.parametrize("verdict", Verdict)
def test_an_outcome_is_accepted_if_its_verdict_is(verdict: Verdict) -> None:
    assert Outcome(verdict).accepted == (verdict in ACCEPTED)


def test_accepted_is_what_taught_the_store_something() -> None:
    taught = {"new", "changed", "refreshed", "contended", "left", "lost"}
    assert {verdict.value for verdict in ACCEPTED} == taught


def test_an_outcome_says_no_more_than_it_was_given() -> None:
    outcome = Outcome(Verdict.NEW)
    assert (outcome.entity_id, outcome.repairs, outcome.detail) == ("", (), "")


def test_an_outcome_cannot_be_changed() -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        Outcome(Verdict.NEW).verdict = Verdict.FAULT  # type: ignore[misc]
