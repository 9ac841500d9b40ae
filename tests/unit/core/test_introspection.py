from __future__ import annotations

import json

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.introspection import BeaconMetadata, Introspection, prepare
from beacon_core.lifecycle import Cause, Status
from beacon_core.stored import StoredHint
from beacon_core.testing.examples import BENCH_HINT

SECOND = 10**9
AGE = "x-medkit-beacon-age-sec"


def stored(hint: BeaconHint, status: Status = Status.ACTIVE, last_seen_ns: int = 0) -> StoredHint:
    return StoredHint(
        hint=hint,
        status=status,
        cause=Cause.HEARD,
        detail="",
        last_seen_ns=last_seen_ns,
        first_seen_ns=0,
        source="",
        incarnation="",
        revision=1,
        restarts=0,
    )


def age_read(age_ns: int) -> object:
    metadata = BeaconMetadata({"a": {AGE: -age_ns}}, now_ns=0)
    return metadata["a"][AGE]


def test_every_given_field_has_its_key() -> None:
    assert prepare(stored(BENCH_HINT, last_seen_ns=7)) == {
        "x-medkit-beacon-firmware": "1.2.3",
        "x-medkit-beacon-vendor": "acme",
        "x-medkit-beacon-status": "active",
        "x-medkit-beacon-transport-type": "shared_memory",
        "x-medkit-beacon-negotiated-format": "sensor_msgs/Temperature",
        "x-medkit-beacon-process-id": 4284,
        "x-medkit-beacon-process-name": "engine_temp_node",
        "x-medkit-beacon-hostname": "robot-0000",
        "x-medkit-beacon-stable-id": "stable-engine-temp-000042",
        "x-medkit-beacon-depends-on": ("can_bridge", "power_unit"),
        "x-medkit-beacon-functions": ("thermal", "monitoring"),
        AGE: 7,
    }


def test_what_is_not_given_has_no_key() -> None:
    assert prepare(stored(BeaconHint("a"))) == {"x-medkit-beacon-status": "active", AGE: 0}


@pytest.mark.parametrize("status", [one for one in Status if one is not Status.ACTIVE])
def test_whatever_is_not_active_shows_as_stale(status: Status) -> None:
    fields = prepare(stored(BeaconHint("a"), status))
    assert fields == {"x-medkit-beacon-status": "stale", AGE: 0}


@pytest.mark.parametrize(
    "name",
    [
        "status",
        "age-sec",
        "transport-type",
        "negotiated-format",
        "process-id",
        "process-name",
        "hostname",
        "stable-id",
        "depends-on",
        "functions",
    ],
)
def test_free_metadata_never_takes_a_structured_keys_place(name: str) -> None:
    hint = BeaconHint("a", metadata={name: "spoof", "free": "1"})
    fields = prepare(stored(hint, last_seen_ns=7))
    assert fields == {"x-medkit-beacon-free": "1", "x-medkit-beacon-status": "active", AGE: 7}


@pytest.mark.parametrize(
    ("age_ns", "age_sec"),
    [
        (0, 0.0),
        (999_999, 0.0),
        (1_000_000, 0.001),
        (1_999_999, 0.001),
        (86_400_123_000_000, 86400.123),
        (-999_999, 0.0),
        (-1_999_999, -0.001),
        (-2_500_000_000, -2.5),
    ],
)
def test_an_age_is_in_seconds_cut_to_whole_milliseconds_toward_zero(
    age_ns: int, age_sec: float
) -> None:
    assert age_read(age_ns) == age_sec
    assert isinstance(age_read(age_ns), float)


def test_a_live_age_follows_the_newest_message() -> None:
    seen: dict[str, int] = {"a": 1 * SECOND}
    metadata = BeaconMetadata({"a": {AGE: 1 * SECOND}}, 5 * SECOND, seen.get)
    assert metadata["a"][AGE] == 4.0
    seen["a"] = 3 * SECOND
    assert metadata["a"][AGE] == 2.0


def test_a_live_age_is_never_below_zero() -> None:
    metadata = BeaconMetadata({"a": {AGE: 0}}, 5 * SECOND, {"a": 6 * SECOND}.get)
    assert metadata["a"][AGE] == 0.0


def test_the_age_of_an_entity_that_is_gone_is_the_one_it_was_mapped_with() -> None:
    metadata = BeaconMetadata({"a": {AGE: 2 * SECOND}}, 5 * SECOND, lambda _: None)
    assert metadata["a"][AGE] == 3.0


def test_metadata_is_a_mapping_by_entity_id() -> None:
    metadata = BeaconMetadata({"b": {AGE: 0}, "a": {AGE: 0, "k": "v"}}, 0)
    assert (list(metadata), len(metadata)) == (["b", "a"], 2)
    assert "a" in metadata
    assert "c" not in metadata
    assert metadata.get("c") is None
    with pytest.raises(KeyError):
        metadata["c"]


def test_what_is_read_may_be_changed_without_effect() -> None:
    metadata = BeaconMetadata({"a": prepare(stored(BENCH_HINT))}, 0)
    metadata["a"].clear()
    assert metadata["a"]["x-medkit-beacon-status"] == "active"


def test_what_is_read_is_fit_for_json() -> None:
    metadata = BeaconMetadata({"a": prepare(stored(BENCH_HINT))}, 0)
    assert json.loads(json.dumps(metadata["a"]))["x-medkit-beacon-functions"] == [
        "thermal",
        "monitoring",
    ]


def test_two_introspections_that_say_the_same_are_equal() -> None:
    def say(age_ns: int) -> Introspection:
        return Introspection(1, (), (), (), BeaconMetadata({"a": {AGE: 0}}, age_ns))

    assert say(0) == say(0)
    assert say(0) != say(SECOND)
