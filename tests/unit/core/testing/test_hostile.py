"""Hostile inputs are what they say they are."""

from __future__ import annotations

import pytest

from beacon_core.hint import Announcement
from beacon_core.limits import MAX_PAYLOAD_BYTES
from beacon_core.ports.adapter import Malformed
from beacon_core.testing.hostile import (
    HOSTILE_CDR,
    HOSTILE_IDS,
    HOSTILE_JSON,
    HOSTILE_PAYLOADS,
    OVERSIZE_PAYLOAD,
)
from beacon_core.validator import is_valid_id
from beacon_core.wire import cdr, json


@pytest.mark.parametrize("kind", HOSTILE_PAYLOADS)
def test_a_hostile_payload_is_a_hint_in_no_wire_format(kind: str) -> None:
    payload = HOSTILE_PAYLOADS[kind]
    assert len(payload) <= MAX_PAYLOAD_BYTES
    assert isinstance(json.decode(payload), Malformed)
    assert isinstance(cdr.decode(payload), Malformed)


@pytest.mark.parametrize("kind", HOSTILE_JSON)
def test_hostile_json_is_about_one_entity_or_refused(kind: str) -> None:
    found = json.decode(HOSTILE_JSON[kind])
    assert isinstance(found, Malformed) or found.hint.entity_id == "hostile"


def test_some_hostile_json_must_be_repaired() -> None:
    found = [json.decode(payload) for payload in HOSTILE_JSON.values()]
    assert sum(isinstance(one, Announcement) and bool(one.repairs) for one in found) >= 10


@pytest.mark.parametrize("kind", HOSTILE_CDR)
def test_a_hostile_ros_message_is_about_one_entity_or_refused(kind: str) -> None:
    found = cdr.decode(HOSTILE_CDR[kind])
    assert isinstance(found, Malformed) or found.hint.entity_id in ("hostile", "") or "for" in kind


@pytest.mark.parametrize("kind", HOSTILE_IDS)
def test_a_hostile_id_is_none(kind: str) -> None:
    assert not is_valid_id(HOSTILE_IDS[kind])


def test_the_oversize_payload_is_over_the_limit() -> None:
    assert len(OVERSIZE_PAYLOAD) > MAX_PAYLOAD_BYTES
