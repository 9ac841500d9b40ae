from __future__ import annotations

from beacon_core.relay.values import Mode, Qos, TopicType


def test_the_numbers_of_modes_are_those_on_the_wire() -> None:
    assert [mode.value for mode in Mode] == [0, 1, 2, 3]


def test_types_of_one_name_differ_by_their_hash() -> None:
    assert TopicType("a/msg/B", "1") != TopicType("a/msg/B", "2")
    assert Qos() == Qos(reliable=True, durable=False, depth=10)
