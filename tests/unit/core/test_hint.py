"""The hint: which fields it has, what "not given" is, and that nobody can change it."""

from __future__ import annotations

import attrs
import pytest

from beacon_core.hint import NO_METADATA, Announcement, BeaconHint

ROS_MESSAGE = [
    "entity_id",
    "stable_id",
    "display_name",
    "function_ids",
    "depends_on",
    "component_id",
    "transport_type",
    "negotiated_format",
    "process_id",
    "process_name",
    "hostname",
    "metadata",
]


def test_the_fields_are_those_of_the_ros_message_in_its_order() -> None:
    assert [field.name for field in attrs.fields(BeaconHint)] == ROS_MESSAGE


def test_only_the_entity_id_is_required_and_the_rest_is_empty() -> None:
    hint = BeaconHint("a")
    assert not any(getattr(hint, name) for name in ROS_MESSAGE[1:])


def test_two_hints_that_say_the_same_are_equal() -> None:
    assert BeaconHint("a", metadata={"k": "v"}) == BeaconHint("a", metadata={"k": "v"})
    assert BeaconHint("a", metadata={"k": "v"}) != BeaconHint("a", metadata={"k": "w"})
    assert BeaconHint("a", metadata={}) == BeaconHint("a")


@pytest.mark.parametrize("name", ROS_MESSAGE)
def test_a_hint_cannot_be_changed(name: str) -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        setattr(BeaconHint("a"), name, "b")


def test_the_shared_empty_metadata_cannot_be_changed() -> None:
    assert BeaconHint("a").metadata is NO_METADATA
    with pytest.raises(TypeError):
        NO_METADATA["k"] = "v"  # type: ignore[index]


def test_an_announcement_has_no_stamp_and_no_repairs_unless_given() -> None:
    announcement = Announcement(BeaconHint("a"))
    assert (announcement.stamp_ns, announcement.repairs) == (0, ())
