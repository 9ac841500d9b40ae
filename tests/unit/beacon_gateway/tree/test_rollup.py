"""Who is active with all it depends on; against an oracle that knows no cleverness."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.stored import StoredHint
from beacon_gateway.tree.rollup import RollUp, RollUps, fault_of, roll_up
from beacon_gateway.views import Beacon, View

Graph = Mapping[str, tuple[str, ...]]


def beacon(status: Status, cause: Cause, detail: str = "") -> Beacon:
    stored = StoredHint(
        hint=BeaconHint("a"),
        status=status,
        cause=cause,
        detail=detail,
        last_seen_ns=0,
        first_seen_ns=0,
        source="",
        incarnation="",
        revision=1,
        restarts=0,
    )
    return Beacon((View("robots", "fake", stored),))


@pytest.mark.parametrize(
    ("said", "known", "heard", "reason"),
    [
        (beacon(Status.ACTIVE, Cause.HEARD), True, True, ""),
        (beacon(Status.STALE, Cause.SILENT), True, True, "a is stale: it is silent"),
        (beacon(Status.STALE, Cause.LOST), True, True, "a is stale: it is silent"),
        (beacon(Status.STALE, Cause.LOST, "link down"), True, True, "a is stale: link down"),
        (beacon(Status.LEFT, Cause.GOODBYE), True, True, "a said goodbye"),
        (None, True, False, "a was never heard"),
        (None, True, True, "a is not heard any more"),
        (None, False, True, "a is unknown"),
    ],
)
def test_what_is_wrong_is_one_sentence(
    said: Beacon | None, *, known: bool, heard: bool, reason: str
) -> None:
    assert fault_of("a", said, known=known, heard=heard) == reason


def both(graph: Graph, *faulty: str) -> dict[str, RollUp]:
    """All at once and one by one, which must be the same."""

    def fault(entity_id: str) -> str:
        return f"{entity_id} is broken" if entity_id in faulty or entity_id not in graph else ""

    def depends_on(entity_id: str) -> tuple[str, ...]:
        return graph.get(entity_id, ())

    at_once = dict(RollUps(graph, depends_on, fault))
    assert {one: roll_up(one, depends_on, fault) for one in graph} == at_once
    return at_once


def test_all_is_well() -> None:
    assert both({"a": ("b",), "b": ()}) == {"a": RollUp(active=True), "b": RollUp(active=True)}


def test_the_chain_leads_to_the_one_at_fault() -> None:
    found = both({"a": ("b",), "b": ("c",), "c": (), "d": ()}, "c")
    assert found["a"] == RollUp(active=False, chain=("a", "b", "c"), reason="c is broken")
    assert found["c"] == RollUp(active=False, chain=("c",), reason="c is broken")
    assert found["d"].active


def test_who_is_unknown_is_at_fault() -> None:
    found = both({"a": ("nobody",)})
    assert found["a"].chain == ("a", "nobody")


def test_the_nearest_comes_first_and_of_equals_the_one_named_first() -> None:
    graph: Graph = {"a": ("far", "y", "x"), "far": ("z",), "x": (), "y": (), "z": ()}
    assert both(graph, "z", "x", "y")["a"].chain == ("a", "y")
    assert both(graph, "z")["a"].chain == ("a", "far", "z")


def test_a_cycle_harms_nobody_unless_one_on_it_is_at_fault() -> None:
    graph: Graph = {"a": ("b",), "b": ("c",), "c": ("a",), "self": ("self",)}
    assert all(one.active for one in both(graph).values())
    found = both(graph, "c")
    assert {one: roll.chain for one, roll in found.items()} == {
        "a": ("a", "b", "c"),
        "b": ("b", "c"),
        "c": ("c",),
        "self": (),
    }


def test_who_is_not_in_the_tree_has_no_roll_up() -> None:
    found = RollUps(["a"], lambda _: ("b",), lambda _: "")
    assert len(found) == 1
    assert "b" not in found
    with pytest.raises(KeyError):
        found["b"]


def test_ten_thousand_in_a_row_are_looked_at_once_each() -> None:
    looked: list[str] = []

    def fault(entity_id: str) -> str:
        looked.append(entity_id)
        return "it broke" if entity_id == "9999" else ""

    found = RollUps(
        map(str, range(10_000)), lambda one: [str(int(one) + 1)][: one != "9999"], fault
    )
    assert len(looked) == 10_000
    assert len(found["0"].chain) == 10_000


names = st.sampled_from("abcdef")
graphs = st.dictionaries(names, st.lists(names, max_size=4).map(tuple), max_size=6)


def oracle(graph: Graph, faulty: set[str], start: str) -> RollUp:
    """All ways that meet nobody twice, the shortest first, in the order in which they are named."""
    ways: list[tuple[str, ...]] = [(start,)]
    while ways:
        for way in ways:
            if way[-1] in faulty or way[-1] not in graph:
                return RollUp(active=False, chain=way, reason=f"{way[-1]} is broken")
        ways = [(*way, one) for way in ways for one in graph[way[-1]] if one not in way]
    return RollUp(active=True)


@settings(deadline=None)
@given(graphs, st.sets(names, max_size=3))
def test_it_is_what_the_oracle_says(graph: Graph, faulty: set[str]) -> None:
    assert both(graph, *faulty) == {one: oracle(graph, faulty, one) for one in graph}
