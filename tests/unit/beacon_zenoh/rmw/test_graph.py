"""The graph: right after any order of reports, however often each is repeated; and bounded."""

from __future__ import annotations

import attrs
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.tokens import Kind, Member, token_key

TALKER = Member(Kind.NODE, 0, "ab", 1, 1, "talker", "/fleet")
CHATTER = attrs.evolve(
    TALKER,
    kind=Kind.PUBLISHER,
    member_id=2,
    name="/chatter",
    type_name="std_msgs/msg/String",
    type_hash="RIHS01_0",
)
SERVICE = attrs.evolve(CHATTER, kind=Kind.SERVICE, member_id=3, name="/fleet/talker/get")
LISTENER = Member(Kind.NODE, 7, "cd", 1, 1, "listener")
MEMBERS = [TALKER, CHATTER, SERVICE, LISTENER]
KEYS = [token_key(member) for member in MEMBERS]


def full() -> Graph:
    graph = Graph()
    for key in KEYS:
        graph.appeared(key)
    return graph


def names(graph: Graph, domain: int | None = None) -> list[str]:
    return [view.node.node_name for view in graph.nodes(domain)]


def test_what_comes_is_there_with_all_it_has() -> None:
    graph = full()
    assert names(graph) == ["/fleet/talker", "/listener"]
    view = graph.node(TALKER.node_key)
    assert view is not None
    assert view.of(Kind.PUBLISHER) == (CHATTER,)
    assert view.of(Kind.SERVICE) == (SERVICE,)
    assert (len(graph), graph.size()) == (4, 2)


def test_domains_are_told_apart() -> None:
    assert names(full(), 0) == ["/fleet/talker"]
    assert names(full(), 7) == ["/listener"]
    assert names(full(), 1) == []


def test_the_names_are_the_same_object_until_a_node_comes_or_goes() -> None:
    graph = full()
    found = graph.names()
    assert found == {"/fleet/talker", "/listener"}
    graph.vanished(KEYS[1])
    assert graph.names() is found
    graph.vanished(KEYS[3])
    assert graph.names() == {"/fleet/talker"}
    graph.appeared(KEYS[3])
    assert graph.names() == found


def test_only_news_is_news() -> None:
    graph = Graph()
    assert graph.appeared(KEYS[0]) == TALKER
    assert graph.appeared(KEYS[0]) is None
    assert graph.vanished(KEYS[0]) == TALKER
    assert graph.vanished(KEYS[0]) is None


def test_a_member_may_come_before_its_node_and_stay_behind_it() -> None:
    graph = Graph()
    graph.appeared(KEYS[1])
    assert graph.node(TALKER.node_key) is None
    graph.appeared(KEYS[0])
    assert names(graph) == ["/fleet/talker"]
    graph.vanished(KEYS[0])
    assert names(graph) == []
    assert graph.members_of(TALKER.node_key) == {KEYS[1]: CHATTER}
    graph.vanished(KEYS[1])
    assert graph.members_of(TALKER.node_key) == {}


def test_after_a_doubt_only_who_is_reported_again_stays() -> None:
    graph = full()
    graph.doubt()
    graph.appeared(KEYS[3])
    graph.vanished(KEYS[2])
    assert {member.node for _, member in graph.sweep()} == {"talker"}
    assert names(graph) == ["/listener"]
    assert graph.sweep() == []


def test_what_is_no_token_is_counted() -> None:
    graph = Graph()
    assert graph.appeared("@ros2_lv/nonsense") is None
    assert (graph.malformed, len(graph)) == (1, 0)


def test_a_flood_of_tokens_is_counted_and_ignored() -> None:
    graph = Graph(max_members=2)
    for key in KEYS:
        graph.appeared(key)
    assert (len(graph), graph.refused) == (2, 2)


@settings(deadline=None)
@given(st.lists(st.tuples(st.sampled_from(KEYS), st.booleans()), max_size=30))
def test_it_is_the_set_of_the_tokens_that_came_last_rather_than_went(
    reports: list[tuple[str, bool]],
) -> None:
    graph, present = Graph(), set[str]()
    for key, came in reports:
        if came:
            graph.appeared(key)
            present.add(key)
        else:
            graph.vanished(key)
            present.discard(key)
    expected = {member for member, key in zip(MEMBERS, KEYS, strict=True) if key in present}
    nodes = {view.node for view in graph.nodes()}
    assert nodes == {member for member in expected if member.kind is Kind.NODE}
    of_talker = set(graph.members_of(TALKER.node_key).values())
    assert of_talker == expected & {CHATTER, SERVICE}
    assert len(graph) == len(present)
