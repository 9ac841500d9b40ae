"""A hint and its parameters are two ways to say the same; what is wrong is left out by name."""

from __future__ import annotations

from typing import Any

import attrs
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.errors import UsageError
from beacon_core.hint import NO_METADATA, BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, PREFIX, Reading, is_ours, read, write
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.testing.strategies import hints, raw_hints

D = f"{PREFIX}."


def cleaned(hint: BeaconHint) -> BeaconHint:
    """As ROS can carry it."""

    def clean(value: Any) -> Any:
        if isinstance(value, str):
            return "".join(
                "\ufffd" if char == "\0" or "\ud800" <= char <= "\udfff" else char for char in value
            )
        if isinstance(value, tuple):
            return tuple(clean(one) for one in value)
        return value

    fields = {name: clean(value) for name, value in attrs.asdict(hint, recurse=False).items()}
    fields["metadata"] = {clean(key): clean(text) for key, text in hint.metadata.items()}
    return BeaconHint(**fields)


# Writing


def test_each_given_field_is_a_parameter_and_the_entity_id_is_the_last() -> None:
    parameters = write(BENCH_HINT)
    assert parameters == {
        D + "stable_id": "stable-engine-temp-000042",
        D + "display_name": "Engine temperature 000042",
        D + "function_ids": ["thermal", "monitoring"],
        D + "depends_on": ["can_bridge", "power_unit"],
        D + "component_id": "ecu_front",
        D + "transport_type": "shared_memory",
        D + "negotiated_format": "sensor_msgs/Temperature",
        D + "process_id": 4284,
        D + "process_name": "engine_temp_node",
        D + "hostname": "robot-0000",
        D + "metadata.firmware": "1.2.3",
        D + "metadata.vendor": "acme",
        D + "entity_id": "engine_temp_000042",
    }
    assert list(parameters)[-1] == ENTITY_ID
    assert all(map(is_ours, parameters))


def test_what_is_not_given_is_no_parameter() -> None:
    assert write(BeaconHint("engine")) == {ENTITY_ID: "engine"}


@pytest.mark.parametrize("process_id", [-1, 2**32])
def test_a_process_id_that_no_carrier_can_carry_is_a_mistake_of_the_caller(process_id: int) -> None:
    with pytest.raises(UsageError, match="process_id"):
        write(BeaconHint("engine", process_id=process_id))


@settings(max_examples=50, deadline=None)
@given(st.one_of(hints(), raw_hints()))
def test_what_is_written_reads_the_same_but_for_what_ros_cannot_carry(hint: BeaconHint) -> None:
    reading = read(write(hint))
    said = cleaned(hint)
    if "" in said.metadata:
        said = attrs.evolve(
            said, metadata={key: said.metadata[key] for key in said.metadata if key}
        )
    assert reading.hint == (said if said.entity_id else None)
    assert len(reading.skipped) == ("" in hint.metadata)


# Reading


def test_without_parameters_there_is_no_hint_and_nothing_to_report() -> None:
    assert read({}).hint is None
    assert (
        read({"use_sim_time": True, f"{PREFIX}": "x", f"{PREFIX}er.entity_id": "x"}).skipped == ()
    )


def test_a_hint_without_metadata_shares_the_empty_one() -> None:
    hint = read({ENTITY_ID: "engine"}).hint
    assert hint is not None
    assert hint.metadata is NO_METADATA


@pytest.mark.parametrize("value", [7, True, ["engine"], b"engine"])
def test_an_entity_id_of_another_type_is_no_hint_and_that_is_said(value: object) -> None:
    reading = read({ENTITY_ID: value, D + "display_name": "Engine"})
    assert reading.hint is None
    (line,) = reading.skipped
    assert line.startswith(f"'{ENTITY_ID}': expected a string")


@pytest.mark.parametrize("others", [{D + "display_name": "Engine"}, {D + "metadata.vendor": "a"}])
def test_parameters_without_an_entity_id_are_no_hint_and_that_is_said(
    others: dict[str, object],
) -> None:
    missing = f"{ENTITY_ID}: not given, so nobody knows whom the others are about"
    assert read(others) == Reading(None, (missing,))
    assert read({**others, ENTITY_ID: None}) == Reading(None, (missing,))


def test_an_emptied_entity_id_is_a_hint_taken_back_and_no_mistake() -> None:
    assert read({ENTITY_ID: "", D + "display_name": "Engine"}) == Reading(None)


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        ("display_name", 7, "expected a string, found 7"),
        ("display_name", True, "expected a string, found a boolean"),
        ("display_name", 7.5, "expected a string, found a double"),
        ("display_name", ["a"], "expected a string, found an array"),
        ("hostname", b"robot", "expected a string, found an array"),
        ("function_ids", "thermal", "expected an array of strings, found a string"),
        ("depends_on", [1, 2], "expected an array of strings, found an array"),
        ("process_id", "7", "expected an integer 0..4294967295, found a string"),
        ("process_id", True, "expected an integer 0..4294967295, found a boolean"),
        ("process_id", -1, "expected an integer 0..4294967295, found -1"),
        ("process_id", 2**32, "expected an integer 0..4294967295, found 4294967296"),
        ("metadata.vendor", 7, "expected a string, found 7"),
        ("metadata", "acme", "no field of a hint"),
        ("metadata.", "acme", "no field of a hint"),
        ("colour", "blue", "no field of a hint"),
        ("display_name.de", "Motor", "no field of a hint"),
        ("", "x", "no field of a hint"),
    ],
)
def test_what_is_wrong_is_left_out_and_named_and_the_rest_counts(
    field: str, value: object, complaint: str
) -> None:
    reading = read({D + field: value, ENTITY_ID: "engine", D + "stable_id": "sn-1"})
    assert reading.hint == BeaconHint("engine", stable_id="sn-1")
    assert reading.skipped == (f"'{D}{field}': {complaint}",)


@pytest.mark.parametrize("field", ["display_name", "function_ids", "process_id", "metadata.key"])
def test_a_parameter_without_a_value_is_as_good_as_none(field: str) -> None:
    assert read({ENTITY_ID: "engine", D + field: None}) == read({ENTITY_ID: "engine"})


@pytest.mark.parametrize("empty", [[], ()])
def test_an_empty_array_is_a_list_that_is_not_given(empty: object) -> None:
    reading = read({ENTITY_ID: "engine", D + "function_ids": empty})
    assert reading.hint == BeaconHint("engine")
    assert not reading.skipped


def test_a_metadata_key_may_hold_dots_and_is_left_to_the_validator() -> None:
    hint = read({ENTITY_ID: "engine", D + "metadata.a.b": "c"}).hint
    assert hint is not None
    assert hint.metadata == {"a.b": "c"}


def test_a_foreign_name_cannot_forge_a_line_of_the_log() -> None:
    (line,) = read({D + "x\nERROR all is lost" + "!" * 10_000: 1, ENTITY_ID: "e"}).skipped
    assert "\n" not in line
    assert len(line) < 200


_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.binary(),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=4,
)
_NAMES = st.sampled_from(
    [D + field.name for field in attrs.fields(BeaconHint)]
    + [D + "metadata.key", D, PREFIX, "", "use_sim_time", D + "."]
)


@given(st.dictionaries(_NAMES | st.text(max_size=12), _VALUES, max_size=8))
def test_reading_never_raises(parameters: dict[str, object]) -> None:
    reading = read(parameters)
    if reading.hint is not None:
        assert reading.hint.entity_id == parameters[ENTITY_ID]
