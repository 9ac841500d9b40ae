"""What another store knew before: shown with the doubt, until it is heard or has expired."""

from __future__ import annotations

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.outcome import Verdict
from tests.unit.core.house import EXPIRY, TTL, House, S

ACTIVE, STALE = Status.ACTIVE, Status.STALE


@pytest.fixture
def house() -> House:
    return House()


def restore(house: House, entity_id: str = "e", *, age_ns: int = 0, **known: object) -> Verdict:
    at_ns = house.now - age_ns
    given = {"source": "r", **known}
    hint = BeaconHint(entity_id, display_name="Known", hostname="h")
    return house.store.restore(hint, last_seen_ns=at_ns, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize("age_ns", [0, S, TTL, EXPIRY - 1])
def test_it_is_stale_and_keeps_its_age(house: House, age_ns: int) -> None:
    assert restore(house, age_ns=age_ns, restarts=3) is Verdict.NEW
    stored = house.get()
    assert (stored.status, stored.cause) == (STALE, Cause.HEARD_LATE)
    assert stored.detail == "known from before a restart, and not heard since"
    assert stored.age_ns(house.now) == age_ns
    assert stored.restarts == 3
    assert stored.history == ()
    assert [one.entity_id for one in house.store.changes_since(0).hints] == ["e"]
    assert house.store.stats().stale == 1


def test_it_expires_when_it_would_have_expired(house: House) -> None:
    restore(house, age_ns=EXPIRY - S)
    house.wait(S - 1)
    assert house.status() is STALE
    house.wait(1)
    assert house.status() is None
    assert house.store.stats().expired == 1


def test_what_has_expired_is_not_brought_back(house: House) -> None:
    assert restore(house, age_ns=EXPIRY) is Verdict.OLDER
    assert house.store.size() == 0


def test_it_may_have_been_heard_before_the_clock_began(house: House) -> None:
    assert restore(house, age_ns=house.now + S) is Verdict.NEW
    assert house.get().last_seen_ns == -S


def test_the_future_counts_as_now(house: House) -> None:
    restore(house, age_ns=-TTL)
    assert house.get().age_ns(house.now) == 0


def test_whoever_is_heard_again_goes_on_living(house: House) -> None:
    restore(house, age_ns=S, incarnation="i")
    assert house.hear(incarnation="i", sequence=7) is Verdict.REFRESHED
    stored = house.get()
    assert (stored.status, stored.cause, stored.detail) == (ACTIVE, Cause.HEARD, "")
    assert stored.hint.display_name == "Known"
    assert stored.restarts == 0


def test_another_life_under_its_id_is_a_restart(house: House) -> None:
    restore(house, age_ns=S, incarnation="i", restarts=1)
    assert house.hear(incarnation="j", sequence=1) is Verdict.CHANGED
    assert house.get().restarts == 2
    assert house.get().hint.display_name == ""


def test_who_is_known_already_knows_better(house: House) -> None:
    house.hear()
    assert restore(house) is Verdict.OLDER
    assert house.status() is ACTIVE


def test_it_gives_way_and_takes_no_room_from_the_living() -> None:
    house = House(max_hints=1)
    restore(house, "old")
    house.hear("new")
    assert house.status("old") is None
    assert restore(house, "older") is Verdict.STORE_FULL
    assert house.status("new") is ACTIVE
