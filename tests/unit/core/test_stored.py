"""What the store gives out: values that say what was true at one moment."""

from __future__ import annotations

from typing import Any

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.stored import Changes, Claim, StoredHint, StoreStats


def stored(**fields: Any) -> StoredHint:
    usual: dict[str, Any] = {
        "hint": BeaconHint("a"),
        "status": Status.ACTIVE,
        "cause": Cause.HEARD,
        "detail": "",
        "last_seen_ns": 100,
        "first_seen_ns": 50,
        "source": "robot",
        "incarnation": "",
        "revision": 1,
        "restarts": 0,
    }
    return StoredHint(**usual | fields)


def test_it_goes_by_the_id_of_its_hint() -> None:
    assert stored(hint=BeaconHint("engine")).entity_id == "engine"


def test_without_rival_claims_there_is_no_conflict() -> None:
    assert not stored().conflict


def test_with_claims_there_is_one() -> None:
    mine = Claim(BeaconHint("a", hostname="h1"), "robot-1", "", 100)
    theirs = Claim(BeaconHint("a", hostname="h2"), "robot-2", "", 90)
    assert stored(claims=(mine, theirs)).conflict


@pytest.mark.parametrize(("now_ns", "age_ns"), [(100, 0), (101, 1), (10**18, 10**18 - 100)])
def test_its_age_is_counted_from_when_it_was_last_heard(now_ns: int, age_ns: int) -> None:
    assert stored(last_seen_ns=100).age_ns(now_ns) == age_ns


def test_its_age_is_never_negative() -> None:
    # A reader's "now" may have been taken before the message came.
    assert stored(last_seen_ns=100).age_ns(99) == 0


@pytest.mark.parametrize("kind", [StoredHint, Claim, Changes, StoreStats])
def test_what_was_given_out_cannot_be_changed(kind: type[Any]) -> None:
    fields = attrs.fields(kind)
    value = kind(**{field.name: None for field in fields})
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        setattr(value, fields[0].name, 1)
