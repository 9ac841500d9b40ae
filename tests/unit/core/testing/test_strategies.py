"""What is promised of the strategies: honest hints are clean, careless ones break every limit."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, Phase, find, given, settings
from hypothesis import strategies as st

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.limits import MAX_PAYLOAD_BYTES
from beacon_core.ports.adapter import Malformed
from beacon_core.testing.strategies import hints, hostile_payloads, ids, raw_hints, stamps
from beacon_core.validator import Accepted, Rejected, is_valid_id, validate
from beacon_core.wire import cdr, json

# A hostile payload may be long; no failing example is printed here.
pytestmark = pytest.mark.filterwarnings("ignore:Generating overly large repr")

OFTEN = settings(max_examples=50, deadline=None)
# Any example will do, so none is made smaller.
SEARCH = settings(
    max_examples=3_000,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)


@OFTEN
@given(ids())
def test_ids_are_valid(entity_id: str) -> None:
    assert is_valid_id(entity_id)


@OFTEN
@given(st.integers(1, 300).flatmap(lambda size: st.tuples(st.just(size), ids(size))))
def test_ids_keep_the_length_asked_for(drawn: tuple[int, str]) -> None:
    size, entity_id = drawn
    assert 1 <= len(entity_id) <= size


@OFTEN
@given(hints())
def test_hints_are_accepted_without_a_repair(hint: BeaconHint) -> None:
    assert validate(hint) == Accepted(hint, ())


@OFTEN
@given(hints() | raw_hints(), stamps())
def test_hints_and_stamps_fit_every_wire_format(hint: BeaconHint, stamp_ns: int) -> None:
    assert len(json.encode(hint, stamp_ns)) <= MAX_PAYLOAD_BYTES
    assert len(cdr.encode(hint, stamp_ns)) <= MAX_PAYLOAD_BYTES


@OFTEN
@given(hostile_payloads())
def test_hostile_payloads_are_bytes(payload: bytes) -> None:
    assert type(payload) is bytes


@pytest.mark.parametrize(
    "interesting",
    [
        lambda hint: len(hint.entity_id) == 256,
        lambda hint: len(hint.display_name.encode()) == 512 and not hint.display_name.isascii(),
        lambda hint: len(hint.function_ids) == 100,
        lambda hint: len(hint.metadata) == 50,
        lambda hint: any(len(key) == 64 for key in hint.metadata),
        lambda hint: any(len(value.encode()) == 1024 for value in hint.metadata.values()),
        lambda hint: hint.stable_id == hint.hostname == "",
        lambda hint: not hint.hostname.isascii(),
    ],
)
def test_hints_reach_the_edges_of_what_is_allowed(
    interesting: Callable[[BeaconHint], bool],
) -> None:
    find(hints(), interesting, settings=SEARCH)


@pytest.mark.parametrize(
    "interesting",
    [
        lambda hint: isinstance(validate(hint), Rejected),
        lambda hint: isinstance(found := validate(hint), Accepted) and len(found.repairs) == 1,
        lambda hint: isinstance(found := validate(hint), Accepted) and len(found.repairs) > 20,
        lambda hint: "\ud800" in hint.hostname,
        lambda hint: len(hint.display_name) > 512,
        lambda hint: len(hint.depends_on) > 100,
        lambda hint: len(hint.metadata) > 50,
        lambda hint: any(not is_valid_id(key) for key in hint.metadata),
        lambda hint: any(len(value) > 1024 for value in hint.metadata.values()),
        lambda hint: any(not is_valid_id(entry) for entry in hint.function_ids),
    ],
)
def test_raw_hints_break_every_limit(interesting: Callable[[BeaconHint], bool]) -> None:
    find(raw_hints(), interesting, settings=SEARCH)


@pytest.mark.parametrize(
    "interesting",
    [
        lambda payload: payload == b"",
        lambda payload: isinstance(json.decode(payload), Announcement),
        lambda payload: isinstance(cdr.decode(payload), Announcement),
        lambda payload: bool(getattr(json.decode(payload), "repairs", ())),
        lambda payload: bool(getattr(cdr.decode(payload), "repairs", ())),
        lambda payload: json.decode(payload) == Malformed("$: nested too deeply"),
        lambda payload: json.decode(payload) == Malformed("$: a number of thousands of digits"),
        lambda payload: "$: not JSON" in getattr(json.decode(payload), "reason", ""),
        lambda payload: "$.metadata" in getattr(cdr.decode(payload), "reason", ""),
        lambda payload: " entries, " in getattr(cdr.decode(payload), "reason", ""),
    ],
)
def test_hostile_payloads_reach_every_corner_of_the_decoders(
    interesting: Callable[[bytes], bool],
) -> None:
    find(hostile_payloads(), interesting, settings=SEARCH)


def test_stamps_include_none_and_the_last() -> None:
    find(stamps(), lambda stamp_ns: stamp_ns == 0, settings=SEARCH)
    find(stamps(), lambda stamp_ns: stamp_ns == 2**31 * 10**9 - 1, settings=SEARCH)
