"""The goodbye that travels as a hint with a mark behind it."""

from __future__ import annotations

import pytest

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.testing.hostile import HOSTILE_PAYLOADS
from beacon_core.wire import cdr
from beacon_core.wire.medkit import GOODBYE, NO_STAMP, farewell, said_goodbye


def test_a_farewell_names_whom_it_is_for() -> None:
    assert said_goodbye(farewell("engine_temp")) == "engine_temp"


def test_a_reader_that_knows_no_goodbyes_finds_a_hint_that_is_long_over() -> None:
    for payload in (farewell("engine_temp"), farewell("engine_temp").removesuffix(GOODBYE)):
        assert cdr.decode(payload) == Announcement(BeaconHint("engine_temp"), 1)


def test_a_hint_is_no_farewell() -> None:
    payload = cdr.encode(BeaconHint("engine_temp"))
    assert said_goodbye(payload) == ""
    assert payload.endswith(NO_STAMP)


def test_the_mark_keeps_the_message_aligned() -> None:
    assert len(GOODBYE) % 4 == 0


@pytest.mark.parametrize("payload", HOSTILE_PAYLOADS.values(), ids=HOSTILE_PAYLOADS)
def test_what_is_no_hint_says_no_goodbye_with_the_mark_either(payload: bytes) -> None:
    assert said_goodbye(payload) == ""
    assert said_goodbye(payload + GOODBYE) == ""
