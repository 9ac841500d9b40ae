from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.relay.alarms import Alarms


def test_the_earliest_is_due_first() -> None:
    alarms: Alarms[str] = Alarms()
    assert alarms.next_ns() is None
    assert alarms.pop_due(100) is None
    alarms.set("late", 20)
    alarms.set("early", 10)
    assert alarms.next_ns() == 10
    assert alarms.pop_due(9) is None
    assert [alarms.pop_due(20), alarms.pop_due(20), alarms.pop_due(20)] == ["early", "late", None]


def test_a_name_has_one_time_and_may_lose_it() -> None:
    alarms: Alarms[str] = Alarms()
    alarms.set("a", 10)
    alarms.set("a", 30)
    alarms.set_if_none("a", 5)
    alarms.set_if_none("b", 20)
    assert alarms.next_ns() == 20
    alarms.cancel("b")
    alarms.cancel("never set")
    assert alarms.pop_due(29) is None
    assert alarms.pop_due(30) == "a"


def test_it_says_when_the_next_time_may_be_another_one() -> None:
    alarms: Alarms[str] = Alarms()

    def changed() -> bool:
        was, alarms.changed = alarms.changed, False
        return was

    assert not changed()
    alarms.set("a", 10)
    assert changed()
    alarms.set_if_none("a", 5)
    alarms.cancel("never set")
    assert alarms.pop_due(9) is None
    assert not changed()
    alarms.set_if_none("b", 5)
    assert changed()
    alarms.cancel("b")
    assert changed()
    assert alarms.pop_due(10) == "a"
    assert changed()


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.none() | st.integers(0, 9)), max_size=300))
def test_it_is_a_table_sorted_by_time(steps: list[tuple[int, int | None]]) -> None:
    alarms: Alarms[int] = Alarms()
    table: dict[int, int] = {}
    for key, due in steps:
        if due is None:
            alarms.cancel(key)
            table.pop(key, None)
        else:
            alarms.set(key, due)
            table[key] = due
        assert alarms.next_ns() == min(table.values(), default=None)
        # However often a name is set again, what is kept is bounded.
        assert len(alarms._heap) <= 2 * len(table) + 66


def test_names_set_again_and_again_are_not_piled_up() -> None:
    alarms: Alarms[str] = Alarms()
    for due in range(1000):
        alarms.set("a", due)
        alarms.set("b", -due)
    assert len(alarms._heap) < 100
    assert alarms.pop_due(-999) == "b"
