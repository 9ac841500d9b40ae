"""The one honest hint that examples and measurements use."""

from __future__ import annotations

import json

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.testing.examples import BENCH_HINT, bench_hint
from beacon_core.validator import Accepted, validate


def compact(hint: BeaconHint) -> bytes:
    return json.dumps(attrs.asdict(hint), separators=(",", ":")).encode()


def test_it_has_the_size_that_every_measurement_states() -> None:
    assert 420 <= len(compact(BENCH_HINT)) <= 440


def test_every_field_is_given() -> None:
    assert all(attrs.asdict(BENCH_HINT).values())


@pytest.mark.parametrize("number", [0, 42, 99_999, 100_000, 999_999])
def test_a_fleet_s_hints_are_all_of_that_size_and_valid(number: int) -> None:
    hint = bench_hint(number)
    assert 420 <= len(compact(hint)) <= 440
    assert validate(hint) == Accepted(hint, ())


def test_no_two_hints_of_a_fleet_are_about_the_same_entity_or_process() -> None:
    fleet = [bench_hint(number) for number in range(1_000)]
    assert len({hint.entity_id for hint in fleet}) == len(fleet)
    assert len({hint.process_id for hint in fleet}) == len(fleet)
