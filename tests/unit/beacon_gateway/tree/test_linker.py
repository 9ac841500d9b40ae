"""Which node is which app, and what becomes of the others."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_gateway.tree.entities import App, RosBinding, Tree
from beacon_gateway.tree.linker import (
    Linking,
    Unmanifested,
    binds,
    link,
    runtime_tree,
    whom_to_ask,
)


def app(app_id: str, name: str, namespace: str = "", *, external: bool | None = None) -> App:
    return App(app_id, ros_binding=RosBinding(name, namespace), external=external)


@pytest.mark.parametrize(
    ("name", "namespace", "node", "bound"),
    [
        ("driver", "", "/driver", True),
        ("driver", "/", "/driver", True),
        ("driver", "", "/arm/driver", False),
        ("driver", "/arm", "/arm/driver", True),
        ("driver", "/arm/", "/arm/driver", True),
        ("driver", "/arm", "/arm/left/driver", True),
        ("driver", "/arm", "/army/driver", False),
        ("driver", "/arm", "/driver", False),
        ("driver", "*", "/driver", True),
        ("driver", "*", "/a/b/driver", True),
        ("river", "*", "/driver", False),
        ("Driver", "*", "/driver", False),
        ("costmap/costmap", "", "/costmap/costmap", True),
        ("/costmap/costmap", "/nav", "/nav/costmap/costmap", True),
        ("costmap/costmap", "", "/nav/costmap/costmap", False),
        ("costmap/costmap", "*", "/tmap/costmap", False),
    ],
)
def test_a_node_is_known_by_its_whole_name_and_the_segments_of_its_namespace(
    name: str, namespace: str, node: str, *, bound: bool
) -> None:
    assert binds(RosBinding(name, namespace), node) is bound
    assert link([app("a", name, namespace)], [node]).bound == ({"a": node} if bound else {})


def test_a_node_is_one_app_and_an_app_one_node() -> None:
    apps = [app("any", "n", "*"), app("right", "n", "/right"), app("third", "n", "*")]
    found = link(apps, ["/right/n", "/left/n"])
    assert found.bound == {"any": "/left/n", "right": "/right/n"}
    assert found.unbound == ("third",)
    assert found.binding_conflicts == 1
    assert (found.linked_count, found.orphan_count) == (2, 0)


def test_who_has_no_binding_or_is_external_is_not_looked_for() -> None:
    apps = [App("a"), App("b", ros_binding=RosBinding(topic_namespace="/t"))]
    found = link([*apps, app("c", "n", external=True), app("d", "n", external=False)], ["/n"])
    assert found == Linking({"d": "/n"})


def test_whose_node_is_not_there_is_unbound() -> None:
    assert link([app("a", "n")], []) == Linking({}, (), ("a",))


def test_orphans_are_the_nodes_nobody_asked_for_but_hidden_ones() -> None:
    found = link([app("a", "n")], ["/z", "/n", "/_hidden", "/arm/_x/y", "/b", "/b"])
    assert found.orphans == ("/b", "/z")


def test_a_hidden_node_may_be_bound_on_purpose() -> None:
    assert link([app("a", "_n")], ["/_n"]).bound == {"a": "/_n"}


def test_the_graph_says_who_is_online() -> None:
    found = link([app("a", "n")], ["/n", "/other"])
    assert runtime_tree(found, show_orphans=False) == Tree(
        apps={"a": App("a", bound_fqn="/n", is_online=True, source="node")}
    )


def test_orphans_become_apps_of_their_names() -> None:
    found = link([], ["/planner", "/arm/driver"])
    assert runtime_tree(found, show_orphans=True).apps == {
        "arm_driver": App(
            "arm_driver", "driver", bound_fqn="/arm/driver", is_online=True, source="node"
        ),
        "planner": App("planner", "planner", bound_fqn="/planner", is_online=True, source="node"),
    }


def test_orphans_that_the_manifest_asks_for_say_so() -> None:
    found = link([], ["/n"], Unmanifested.INCLUDE_AS_ORPHAN)
    assert runtime_tree(found, show_orphans=True).apps["n"].source == "orphan"


def test_no_two_nodes_have_one_id() -> None:
    found = link([app("n", "other")], ["/a/b_c", "/a_b/c", "/a_b_c", "/other", "/n"])
    apps = runtime_tree(found, show_orphans=True).apps
    assert {app_id: one.bound_fqn for app_id, one in apps.items()} == {
        "n": "/other",
        "a_b_c": "/a/b_c",
        "a_b-c": "/a_b/c",
        "a_b_c-node": "/a_b_c",
        "n-node": "/n",
    }


segments = st.sampled_from(["a", "b", "a_b", "_h"])
nodes = st.lists(segments, min_size=1, max_size=3).map(lambda names: "/" + "/".join(names))
apps = st.lists(
    st.builds(
        App,
        st.sampled_from(["p", "q", "r", "s"]),
        ros_binding=st.builds(RosBinding, segments, st.sampled_from(["", "/a", "/a/b", "*"])),
    ),
    max_size=4,
    unique_by=lambda one: one.id,
)


@settings(deadline=None)
@given(apps, st.lists(nodes, max_size=6), st.randoms(use_true_random=False))
def test_whatever_the_graph_each_node_is_counted_once_in_whatever_order_it_is_told(
    known: list[App], told: list[str], chance: random.Random
) -> None:
    found = link(known, told)
    assert link(known, chance.sample(told, len(told))) == found
    bound = list(found.bound.values())
    assert len(set(bound)) == len(bound)
    assert {*bound, *found.orphans} == {one for one in told if one in bound or "/_" not in one}
    assert not {*bound} & {*found.orphans}
    assert {*found.bound, *found.unbound} == {one.id for one in known}
    shown = runtime_tree(found, show_orphans=True).apps
    assert sorted(one.bound_fqn for one in shown.values()) == sorted([*bound, *found.orphans])


@pytest.mark.parametrize(
    ("apps", "nodes", "asked"),
    [
        ([], [], None),
        ([App("a")], ["/a"], None),
        ([app("a", "n"), App("b")], [], {"/n"}),
        ([app("a", "n", "/arm/")], [], {"/arm/n"}),
        ([app("a", "n", "/arm")], ["/arm/left/n"], {"/arm/left/n"}),
        ([app("a", "/costmap/costmap", "nav")], [], {"/nav/costmap/costmap"}),
        ([app("a", "n", "*"), app("b", "m")], [], None),
        ([app("a", "n", "*"), app("b", "m")], ["/x/n"], {"/x/n", "/m"}),
        ([app("a", "n", "*"), app("b", "n", "*")], ["/x/n"], None),
        ([app("a", "n", "*", external=True), app("b", "m")], [], {"/m"}),
        ([App("a", ros_binding=RosBinding(topic_namespace="/t")), app("b", "m")], [], {"/m"}),
    ],
)
def test_the_nodes_of_the_apps_are_asked_unless_one_may_be_called_anything(
    apps: list[App], nodes: list[str], asked: set[str] | None
) -> None:
    assert whom_to_ask(apps, link(apps, nodes).bound) == asked


@settings(deadline=None)
@given(
    st.lists(
        st.builds(
            app,
            st.sampled_from("abc"),
            st.sampled_from(["n", "m"]),
            st.sampled_from(["", "/x", "*"]),
        ),
        unique_by=lambda one: one.id,
    ),
    st.frozensets(st.sampled_from(["/n", "/m", "/x/n", "/x/y/n", "/z/m"])),
)
def test_no_node_that_is_bound_goes_unasked(apps: list[App], nodes: frozenset[str]) -> None:
    found = link(apps, nodes).bound
    asked = whom_to_ask(apps, found)
    assert asked is None or set(found.values()) <= asked
