"""A topic of several publishers has one type and one depth, which seldom change."""

from __future__ import annotations

import pytest

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.merging import MAX_DURABLE_DEPTH, by_name, durable_depth, type_of_most
from beacon_core.relay.values import Qos, TopicType

A, A2, B = (
    TopicType(name, digest)
    for name, digest in (("p/msg/A", "1"), ("p/msg/A", "2"), ("p/msg/B", "1"))
)


def before(of: TopicType, depth: int = 1, *, durable: bool = True) -> SeenTopic:
    return SeenTopic(of, Qos(durable=durable, depth=depth))


def test_the_type_is_that_of_most() -> None:
    assert type_of_most([A, B, B], before(A)) == B


def test_among_equals_it_stays_what_it_was() -> None:
    assert type_of_most([A, B], before(B)) == B


@pytest.mark.parametrize("had", [None, before(TopicType("p/msg/C", "1"))])
def test_among_equals_that_it_was_not_it_is_the_first_by_name(had: SeenTopic | None) -> None:
    assert type_of_most([B, A2, A], had) == A


@pytest.mark.parametrize(
    ("depths", "expected"), [([1], 1), ([3], 3), ([1, 1], 2), ([1, 1, 1], 4), ([3, 5, 1], 16)]
)
def test_the_depth_is_that_of_all_together_in_powers_of_two(
    depths: list[int], expected: int
) -> None:
    assert durable_depth(depths, None) == expected


def test_the_depth_does_not_go_back_while_the_topic_is_durable() -> None:
    assert durable_depth([1], before(A, 8)) == 8
    assert durable_depth([1], before(A, 8, durable=False)) == 1


def test_the_depth_has_an_end() -> None:
    assert durable_depth([MAX_DURABLE_DEPTH + 1], None) == MAX_DURABLE_DEPTH


def test_types_are_sorted_by_name_and_then_by_digest() -> None:
    assert sorted([B, A2, A], key=by_name) == [A, A2, B]
