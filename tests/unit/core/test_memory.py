"""Remembered payloads: at hand for a source's first entity, in a bounded table for the others."""

from __future__ import annotations

from beacon_core.claims import Claimant
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.limits import MAX_SHORTCUT_BYTES
from beacon_core.memory import PayloadMemory
from beacon_core.outcome import Verdict
from beacon_core.record import Record
from beacon_core.sources import Source


def record(entity_id: str) -> Record:
    made = Record(Claimant(BeaconHint(entity_id), "r1", "", 0, 0), Status.ACTIVE, Cause.HEARD)
    made.revision = 1
    return made


def test_the_first_entity_of_a_source_is_at_hand_in_its_account() -> None:
    memory, source, one = PayloadMemory(100), Source("r1"), record("a")
    memory.remember(b"p", source, "run", one, 7)
    assert source.payload == b"p"
    assert source.known is not None
    assert source.known[:4] == (source, "run", one, 7)
    assert source.known[4].verdict is Verdict.REFRESHED
    assert source.known[4].entity_id == "a"
    assert memory.recall(b"p") is None


def test_a_later_payload_of_that_entity_takes_its_place_and_keeps_the_outcome() -> None:
    memory, source, one = PayloadMemory(100), Source("r1"), record("a")
    memory.remember(b"p", source, "", one, 1)
    assert source.known is not None
    outcome = source.known[4]
    memory.remember(b"q", source, "", one, 2)
    assert source.payload == b"q"
    assert source.known is not None
    assert source.known[3:] == (2, outcome)


def test_an_ended_entity_frees_the_place() -> None:
    memory, source, one, other = PayloadMemory(100), Source("r1"), record("a"), record("b")
    memory.remember(b"p", source, "", one, 1)
    one.revision = 0
    memory.remember(b"q", source, "", other, 2)
    assert source.payload == b"q"


def test_further_entities_of_a_source_are_in_the_table() -> None:
    memory, source, one, other = PayloadMemory(100), Source("r1"), record("a"), record("b")
    memory.remember(b"p", source, "", one, 1)
    memory.remember(b"q", source, "", other, 2)
    memory.remember(b"r", source, "", other, 3)
    assert source.payload == b"p"
    assert memory.recall(b"q") is None
    known = memory.recall(b"r")
    assert known is not None
    assert known[2:4] == (other, 3)


def test_a_payload_too_large_for_an_account_is_in_the_table() -> None:
    memory, source, one = PayloadMemory(10_000), Source("r1"), record("a")
    large = bytes(MAX_SHORTCUT_BYTES + 1)
    memory.remember(large, source, "", one, 1)
    assert source.payload == b""
    assert memory.recall(large) is not None


def test_a_full_table_is_emptied_and_goes_on() -> None:
    memory, source = PayloadMemory(10), Source("r1")
    memory.remember(b"p", source, "", record("first"), 1)
    memory.remember(b"12345", source, "", record("a"), 1)
    memory.remember(b"67890", source, "", record("b"), 1)
    assert memory.recall(b"12345") is not None
    memory.remember(b"x", source, "", record("c"), 1)
    assert memory.recall(b"12345") is None
    assert memory.recall(b"67890") is None
    assert memory.recall(b"x") is not None


def test_replacing_a_payload_makes_room_for_the_next() -> None:
    memory, source, one = PayloadMemory(10), Source("r1"), record("a")
    memory.remember(b"p", source, "", record("first"), 1)
    for version in range(20):
        memory.remember(bytes([version]) * 6, source, "", one, version)
        assert memory.recall(bytes([version]) * 6) is not None
