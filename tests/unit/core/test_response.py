from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.response import build_response
from beacon_core.stored import StoredHint
from beacon_core.testing.examples import BENCH_HINT

VECTORS = Path(__file__).parents[2] / "data" / "vectors" / "store.jsonl"
NOW_NS = 10**15


def stored(hint: BeaconHint, status: Status = Status.ACTIVE, age_ns: int = 0) -> StoredHint:
    return StoredHint(
        hint=hint,
        status=status,
        cause=Cause.HEARD,
        detail="",
        last_seen_ns=NOW_NS - age_ns,
        first_seen_ns=0,
        source="",
        incarnation="",
        revision=1,
        restarts=0,
    )


UPSTREAM = [
    pytest.param(op["expect"], id=f"{number}-{step}")
    for number, line in enumerate(VECTORS.read_text(encoding="utf-8").splitlines())
    for step, op in enumerate(json.loads(line)["ops"])
    if op["op"] == "response" and op["expect"] is not None
]


@pytest.mark.parametrize("expected", UPSTREAM)
def test_the_body_is_that_of_the_cpp_system(expected: dict[str, Any]) -> None:
    fields: dict[str, Any] = {
        key: tuple(value) if isinstance(value, list) else value for key, value in expected.items()
    }
    status, age_sec = Status(fields.pop("status")), fields.pop("age_sec")
    body = build_response(stored(BeaconHint(**fields), status, round(age_sec * 1e9)), NOW_NS)
    if age_sec < 0:
        # There a stamp from the future gave a negative age; here it counts as just received.
        expected = {**expected, "age_sec": 0.0}
    assert body == expected


def test_all_14_keys_are_there_even_when_nothing_is_given() -> None:
    assert build_response(stored(BeaconHint("a")), NOW_NS) == {
        "entity_id": "a",
        "status": "active",
        "age_sec": 0.0,
        "stable_id": "",
        "display_name": "",
        "transport_type": "",
        "negotiated_format": "",
        "process_id": 0,
        "process_name": "",
        "hostname": "",
        "component_id": "",
        "function_ids": [],
        "depends_on": [],
        "metadata": {},
    }


def test_the_age_has_all_its_nanoseconds() -> None:
    body = build_response(stored(BENCH_HINT, age_ns=1_500_000_001), NOW_NS)
    assert body["age_sec"] == 1.500000001


def test_a_goodbye_shows_as_left() -> None:
    assert build_response(stored(BENCH_HINT, Status.LEFT), NOW_NS)["status"] == "left"


def test_the_body_is_fit_for_json() -> None:
    body = build_response(stored(BENCH_HINT), NOW_NS)
    assert json.loads(json.dumps(body)) == body
