"""Complaints name a few, and tell how many more there are."""

from __future__ import annotations

from beacon_core.parameters.complaints import complaints


def test_where_all_is_well_nothing_is_said() -> None:
    assert not complaints([], (), ())


def test_each_reason_names_its_nodes() -> None:
    assert complaints(["/a"], ["/b"], ["/c"]) == (
        "/a does not answer; /b is not in the ROS graph; "
        "/c is the name of several nodes; rename them"
    )


def test_several_are_told_together() -> None:
    assert complaints(["/a", "/b"], [], []) == "/a, /b do not answer"


def test_of_many_a_few_are_named() -> None:
    assert complaints([], list("abcde"), []) == "a, b, c and 2 more are not in the ROS graph"
