"""What a finding says, and how grave it can be."""

from __future__ import annotations

import attrs
import pytest

from beacon_core.ports.examination import Finding, Level


def test_the_levels_are_the_words_people_and_scripts_read() -> None:
    assert [str(level) for level in Level] == ["ok", "note", "problem"]


def test_advice_is_given_only_where_there_is_something_to_do() -> None:
    assert Finding(Level.OK, "all is well").advice == ""


def test_a_finding_stays_as_it_was() -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        Finding(Level.OK, "all is well").level = Level.PROBLEM  # type: ignore[misc]
