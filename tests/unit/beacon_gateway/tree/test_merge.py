"""Merging layers: ros2_medkit's rules one by one, in both modes; and the laws of the fold."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import attrs
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_gateway.tree.entities import (
    App,
    Area,
    Component,
    Entity,
    Function,
    RosBinding,
    Tree,
)
from beacon_gateway.tree.incremental import IncrementalMerge
from beacon_gateway.tree.merge import Conflict, Layer, MergeResult, fold, merge
from beacon_gateway.tree.policies import (
    BEACONS,
    DEMOTED,
    FIELDS,
    MANIFEST,
    RUNTIME,
    UPSTREAM_FIELDS,
    Group,
    Policy,
    Rule,
)

BOTH_MODES = pytest.mark.parametrize("strict", [False, True], ids=["ours", "strict_upstream"])


def tree(*entities: Entity) -> Tree:
    kinds: dict[type[Entity], dict[str, Any]] = {Area: {}, Component: {}, App: {}, Function: {}}
    for entity in entities:
        kinds[type(entity)][entity.id] = entity
    return Tree(kinds[Area], kinds[Component], kinds[App], kinds[Function])


def manifest(*entities: Entity) -> Layer:
    return Layer("manifest", tree(*entities), MANIFEST)


def runtime(*entities: Entity) -> Layer:
    return Layer("runtime", tree(*entities), RUNTIME)


def beacon(*entities: Entity, name: str = "beacon") -> Layer:
    said = [attrs.evolve(entity, source="beacon") for entity in entities]
    return Layer(name, tree(*said), BEACONS, unites_lists=True)


def app(*layers: Layer, strict: bool) -> App:
    (found,) = merge(layers, strict_upstream=strict).tree.apps.values()
    return found


def function(*layers: Layer, strict: bool) -> Function:
    (found,) = merge(layers, strict_upstream=strict).tree.functions.values()
    return found


@BOTH_MODES
def test_a_manifest_app_that_is_named_and_placed_is_not_changed_by_a_beacon(
    *, strict: bool
) -> None:
    known = App("a", "Name", "ecu", tags=("t",), depends_on=("b",))
    assert app(manifest(known), beacon(App("a", "Other", "other")), strict=strict) == known


@BOTH_MODES
def test_an_empty_name_and_component_of_a_manifest_app_are_filled_by_the_beacon(
    *,
    strict: bool,
) -> None:
    found = app(manifest(App("a")), beacon(App("a", "Name", "ecu")), strict=strict)
    assert found == App("a", "Name", "ecu", source="manifest")


@BOTH_MODES
def test_a_beacon_renames_and_places_a_runtime_app_and_leaves_its_status(*, strict: bool) -> None:
    node = App("a", "node", "old", is_online=True, bound_fqn="/node", source="node")
    found = app(runtime(node), beacon(App("a", "Name", "ecu")), strict=strict)
    assert (found.name, found.component_id) == ("Name", "ecu")
    assert (found.is_online, found.bound_fqn, found.source) == (True, "/node", "node")


@BOTH_MODES
def test_a_beacon_without_lists_wipes_those_of_a_runtime_app_only_in_strict_mode(
    *,
    strict: bool,
) -> None:
    node = App("a", tags=("rt",), depends_on=("x",), source="node")
    found = app(runtime(node), beacon(App("a", "Name")), strict=strict)
    assert (found.tags, found.depends_on) == (((), ()) if strict else (("rt",), ("x",)))


@BOTH_MODES
def test_the_hosts_of_a_runtime_function_are_replaced_in_strict_mode_and_joined_in_ours(
    *,
    strict: bool,
) -> None:
    found = function(
        runtime(Function("f", hosts=("temp", "other"))),
        beacon(Function("f", hosts=("temp",))),
        strict=strict,
    )
    assert found.hosts == (("temp",) if strict else ("temp", "other"))


@BOTH_MODES
def test_the_hosts_of_a_manifest_function_are_extended_by_a_beacon_only_in_ours(
    *,
    strict: bool,
) -> None:
    found = function(
        manifest(Function("f", hosts=("a",))), beacon(Function("f", hosts=("b",))), strict=strict
    )
    assert found.hosts == (("a",) if strict else ("a", "b"))


@BOTH_MODES
def test_a_new_entity_is_a_beacons_app_that_is_not_online(*, strict: bool) -> None:
    found = app(manifest(), runtime(), beacon(App("a")), strict=strict)
    assert found == App("a", source="beacon")
    assert not found.is_online


@BOTH_MODES
def test_of_two_beacons_the_first_wins_scalars_and_lists_are_united(*, strict: bool) -> None:
    first = beacon(App("a", "One", "ecu", ("x", "y")), name="topic")
    second = beacon(App("a", "Two", "other", ("y", "z")), name="param")
    found = app(first, second, strict=strict)
    assert (found.name, found.component_id) == ("One", "ecu")
    assert found.depends_on == ("x", "y", "z")


@BOTH_MODES
def test_a_second_beacons_name_is_ignored_although_the_first_has_none(*, strict: bool) -> None:
    """The group is the first beacon's by then, and the node's name is there."""
    found = app(
        runtime(App("a", "node", source="node")),
        beacon(App("a"), name="topic"),
        beacon(App("a", "Name"), name="param"),
        strict=strict,
    )
    assert found.name == "node"


@BOTH_MODES
def test_one_beacon_creates_and_the_next_one_fills_what_it_left_out(*, strict: bool) -> None:
    found = app(
        beacon(App("a", "Topic"), name="topic"),
        beacon(App("a", "Param", "ecu"), name="param"),
        strict=strict,
    )
    assert (found.name, found.component_id) == ("Topic", "ecu")


@BOTH_MODES
def test_the_first_who_knows_an_entity_stays_its_source(*, strict: bool) -> None:
    layers = (runtime(App("a", source="node")), beacon(App("a", "Name")))
    assert app(*layers, strict=strict).source == "node"
    layers = (manifest(App("a")), runtime(App("a", source="node")))
    assert app(*layers, strict=strict).source == "manifest"


@BOTH_MODES
def test_the_graph_says_who_is_online_and_bound(*, strict: bool) -> None:
    bound = App("a", bound_fqn="/n", is_online=True, source="node")
    found = app(manifest(App("a", "Name")), runtime(bound), beacon(App("a")), strict=strict)
    assert (found.is_online, found.bound_fqn) == (True, "/n")
    demoted = Layer("manifest", tree(App("a", is_online=True)), MANIFEST)
    assert not app(demoted, runtime(App("a")), strict=strict).is_online


@BOTH_MODES
def test_equals_are_online_if_either_says_so(*, strict: bool) -> None:
    on, off = beacon(App("a", is_online=True)), beacon(App("a"), name="second")
    assert app(on, off, strict=strict).is_online
    assert app(off, on, strict=strict).is_online


@BOTH_MODES
def test_a_binding_is_set_by_who_wins_and_filled_only_among_equals(*, strict: bool) -> None:
    binding = RosBinding("n")
    said = App("a", ros_binding=binding, bound_fqn="/n")
    # Metadata: manifest over runtime. Status: runtime over beacon.
    assert app(manifest(App("a")), runtime(said), strict=strict).ros_binding is None
    assert app(runtime(App("a")), beacon(said), strict=strict).bound_fqn == ""
    assert app(runtime(App("a")), beacon(said), strict=strict).ros_binding == binding
    assert app(runtime(said), manifest(App("a")), strict=strict).ros_binding == binding


@BOTH_MODES
def test_not_external_is_a_statement(*, strict: bool) -> None:
    inside, unsaid = App("a", external=False), App("a")
    assert app(manifest(unsaid), runtime(inside), strict=strict).external is False
    outside = App("a", external=True)
    assert app(runtime(outside), manifest(inside), strict=strict).external is False
    assert app(runtime(outside), manifest(unsaid), strict=strict).external is True


@BOTH_MODES
def test_an_identity_is_merged_key_by_key(*, strict: bool) -> None:
    one = Component("c", identity={"serial": "1", "maker": "Acme"})
    other = Component("c", identity={"serial": "2", "model": "X"})
    (found,) = merge(
        (manifest(one), runtime(other)), strict_upstream=strict
    ).tree.components.values()
    assert found.identity == {"serial": "1", "maker": "Acme", "model": "X"}
    (found,) = merge(
        (runtime(other), manifest(one)), strict_upstream=strict
    ).tree.components.values()
    assert found.identity == {"serial": "1", "maker": "Acme", "model": "X"}


@BOTH_MODES
def test_a_manifest_that_may_be_overridden_by_equals_is_only_filled(*, strict: bool) -> None:
    weak = Layer("manifest", tree(App("a", "Name", tags=("m",))), DEMOTED)
    found = app(weak, runtime(App("a", "node", "ecu", tags=("r",))), strict=strict)
    assert (found.name, found.component_id, found.tags) == ("Name", "ecu", ("m", "r"))
    assert app(weak, beacon(App("a", "Beacon")), strict=strict).name == "Beacon"


@BOTH_MODES
def test_two_last_words_are_a_conflict_which_the_first_wins(*, strict: bool) -> None:
    second = Layer("second", tree(App("a", "Other")), MANIFEST)
    result = merge((manifest(App("a", "Name")), second), strict_upstream=strict)
    assert result.tree.apps["a"].name == "Name"
    groups = [Group.IDENTITY, Group.HIERARCHY, Group.METADATA]
    found = {conflict.field_group for conflict in result.conflicts}
    assert found == set(groups)
    assert Conflict("a", Group.IDENTITY, "manifest", "second") in result.conflicts


def test_a_layer_that_only_lists_what_it_adds_is_united_with_what_is_there() -> None:
    node = runtime(Function("f", hosts=("a",)))
    said = attrs.evolve(beacon(Function("f", hosts=("b",))), unites_lists=False)
    assert function(node, said, strict=False).hosts == ("b",)
    assert function(node, beacon(Function("f", hosts=("b",))), strict=False).hosts == ("a", "b")


def test_every_field_of_every_kind_has_its_rule() -> None:
    for table in (FIELDS, UPSTREAM_FIELDS):
        for kind, fields in table.items():
            named = [field.name for field in fields]
            assert sorted(["id", *named]) == sorted(field.name for field in attrs.fields(kind))


def test_the_table_is_ros2_medkits() -> None:
    authoritative, enrichment, fallback = Policy.AUTHORITATIVE, Policy.ENRICHMENT, Policy.FALLBACK
    order = (Group.IDENTITY, Group.HIERARCHY, Group.STATUS, Group.METADATA)
    rows = {
        "manifest": tuple(MANIFEST[group] for group in order),
        "runtime": tuple(RUNTIME[group] for group in order),
        "beacon": tuple(BEACONS[group] for group in order),
        "demoted": tuple(DEMOTED[group] for group in order),
    }
    assert rows == {
        "manifest": (authoritative, authoritative, fallback, authoritative),
        "runtime": (fallback, fallback, authoritative, enrichment),
        "beacon": (enrichment,) * 4,
        "demoted": (fallback,) * 4,
    }


# Laws. Few ids and few words, so that layers meet and disagree often.

ids = st.sampled_from("abc")
words = st.sampled_from(["", "one", "two"])
lists = st.lists(st.sampled_from("xyz"), max_size=3, unique=True).map(tuple)
tri_states = st.sampled_from([None, True, False])
entities = st.one_of(
    st.builds(Area, ids, words, words, words, tags=lists, source=words),
    st.builds(
        Component,
        ids,
        words,
        area=words,
        depends_on=lists,
        identity=st.dictionaries(words, words, max_size=2),
        external=tri_states,
        tags=lists,
        source=words,
    ),
    st.builds(
        App,
        ids,
        words,
        words,
        lists,
        st.none() | st.builds(RosBinding, words),
        words,
        st.booleans(),
        tri_states,
        tags=lists,
        source=words,
    ),
    st.builds(Function, ids, words, lists, lists, source=words),
)
policies = st.fixed_dictionaries({group: st.sampled_from(Policy) for group in Group})
trees = st.lists(entities, max_size=6).map(lambda some: tree(*some))
layers = st.builds(
    Layer, st.sampled_from(["manifest", "runtime", "beacon"]), trees, policies, st.booleans()
)
stacks = st.lists(layers, max_size=4)
modes = st.booleans()
KINDS = ("areas", "components", "apps", "functions")


@settings(deadline=None)
@given(stack=stacks, strict=modes, chance=st.randoms(use_true_random=False))
def test_the_order_of_entities_changes_nothing(
    stack: list[Layer], *, strict: bool, chance: random.Random
) -> None:
    def shuffled(one: Tree) -> Tree:
        kinds = [list(getattr(one, kind).items()) for kind in KINDS]
        for items in kinds:
            chance.shuffle(items)
        return Tree(*map(dict, kinds))

    other = [attrs.evolve(layer, tree=shuffled(layer.tree)) for layer in stack]
    one, two = (merge(given, strict_upstream=strict) for given in (stack, other))
    assert one.tree == two.tree
    assert set(one.conflicts) == set(two.conflicts)
    assert one.enriched == two.enriched


@settings(deadline=None)
@given(stack=stacks, strict=modes, data=st.data())
def test_a_layer_that_is_merged_twice_changes_nothing(
    stack: list[Layer], *, strict: bool, data: st.DataObject
) -> None:
    index = data.draw(st.integers(0, max(0, len(stack) - 1)))
    again = [*stack[: index + 1], *stack[index : index + 1], *stack[index + 1 :]]
    assert merge(again, strict_upstream=strict).tree == merge(stack, strict_upstream=strict).tree


@settings(deadline=None)
@given(stack=stacks, strict=modes)
def test_nobody_is_lost_and_nobody_is_invented(stack: list[Layer], *, strict: bool) -> None:
    result = merge(stack, strict_upstream=strict)
    for kind in KINDS:
        known = {one for layer in stack for one in getattr(layer.tree, kind)}
        assert set(getattr(result.tree, kind)) == known
        assert all(one.id == key for key, one in getattr(result.tree, kind).items())


@settings(deadline=None)
@given(stack=stacks, strict=modes)
def test_every_value_was_said_by_somebody(stack: list[Layer], *, strict: bool) -> None:
    result = merge(stack, strict_upstream=strict)
    for kind in KINDS:
        for entity_id, merged in getattr(result.tree, kind).items():
            said = [one for layer in stack if (one := getattr(layer.tree, kind).get(entity_id))]
            for field in FIELDS[type(merged)]:
                value = getattr(merged, field.name)
                values = [getattr(one, field.name) for one in said]
                if field.rule is Rule.LIST:
                    assert set(value) <= {item for items in values for item in items}
                    assert len(set(value)) == len(value)
                elif field.rule is Rule.MAPPING:
                    assert value.items() <= {item for one in values for item in one.items()}
                else:
                    assert value in values


@settings(deadline=None)
@given(stacks)
def test_no_empty_list_wipes_and_additions_stay(stack: list[Layer]) -> None:
    stack = [attrs.evolve(layer, unites_lists=True) for layer in stack]
    result = merge(stack)
    for kind in KINDS:
        for entity_id, merged in getattr(result.tree, kind).items():
            said = [one for layer in stack if (one := getattr(layer.tree, kind).get(entity_id))]
            for field in FIELDS[type(merged)]:
                if field.rule is Rule.LIST:
                    # The first one's are there whoever comes after; a loser's are not added.
                    assert set(getattr(said[0], field.name)) <= set(getattr(merged, field.name))


@settings(deadline=None)
@given(trees)
def test_one_layer_alone_is_the_result(only: Tree) -> None:
    result = merge([Layer("manifest", only, MANIFEST)])
    assert result == MergeResult(only)


@settings(deadline=None)
@given(stack=stacks, strict=modes)
def test_merging_goes_entity_by_entity(stack: list[Layer], *, strict: bool) -> None:
    result = merge(stack, strict_upstream=strict)
    for entity_id, merged in result.tree.apps.items():
        said = [
            (layer, layer.tree.apps[entity_id]) for layer in stack if entity_id in layer.tree.apps
        ]
        assert fold(said, strict_upstream=strict)[0] == merged


@settings(deadline=None)
@given(stories=st.lists(stacks, max_size=4), strict=modes, data=st.data())
def test_merging_again_gives_the_same_as_merging_from_scratch(
    stories: list[list[Layer]], *, strict: bool, data: st.DataObject
) -> None:
    kept = IncrementalMerge(strict_upstream=strict)
    for stack in stories:
        for now in (stack, changed(stack, data)):
            again, scratch = kept.merge(now), merge(now, strict_upstream=strict)
            assert again.tree == scratch.tree
            assert sorted(again.conflicts, key=str) == sorted(scratch.conflicts, key=str)
            assert again.enriched == scratch.enriched
        assert kept.merge(now).tree is again.tree


def changed(stack: Sequence[Layer], data: st.DataObject) -> list[Layer]:
    """The same layers; in one of them somebody comes, goes or says something else."""
    if not stack:
        return []
    index = data.draw(st.integers(0, len(stack) - 1))
    other = data.draw(trees)
    said = stack[index].tree
    kinds = {kind: {**getattr(said, kind), **getattr(other, kind)} for kind in KINDS}
    for gone in data.draw(st.lists(ids, max_size=2)):
        for kind in kinds.values():
            kind.pop(gone, None)
    layer = attrs.evolve(stack[index], tree=Tree(**kinds))
    if data.draw(st.booleans()):
        # It may say itself who that is, and name others too.
        touched = {
            kind: {
                one
                for one in {*getattr(said, kind), *given}
                if given.get(one) != getattr(said, kind).get(one) or data.draw(st.booleans())
            }
            for kind, given in kinds.items()
        }
        layer = attrs.evolve(layer, touched=touched)
    return [*stack[:index], layer, *stack[index + 1 :]]


def test_merging_again_leaves_who_did_not_change_and_what_was_handed_out_as_they_are() -> None:
    known = manifest(App("a", "One"), App("b", "Two"), Function("f"))
    said = beacon(App("a"), App("b"))
    kept = IncrementalMerge()
    first = kept.merge((known, said)).tree
    other = attrs.evolve(said, tree=attrs.evolve(said.tree, apps={**said.tree.apps, "c": App("c")}))
    second = kept.merge((known, other)).tree
    assert second.apps["b"] is first.apps["b"]
    assert second.functions is first.functions
    assert (set(first.apps), set(second.apps)) == ({"a", "b"}, {"a", "b", "c"})
    assert set(kept.merge((manifest(App("a")),)).tree.apps) == {"a"}


def test_a_layer_that_says_who_has_changed_is_asked_about_nobody_else() -> None:
    known = manifest(App("a", "One"), App("b", "Two"))
    kept = IncrementalMerge()
    kept.merge((known,))
    assert set(kept.folded["apps"]) == {"a", "b"}
    other = Tree(apps={"a": App("a", "Another"), "b": App("b", "Two")})
    now = attrs.evolve(known, tree=other, touched={"apps": ("a",)})
    assert kept.merge((now,)).tree.apps["a"].name == "Another"
    assert {kind: [*ids] for kind, ids in kept.folded.items() if ids} == {"apps": ["a"]}
    kept.merge((now,))
    assert not any(kept.folded.values())


def test_what_is_said_in_vain_leaves_the_tree_the_same_object() -> None:
    known = manifest(App("a", "Name"))
    kept = IncrementalMerge()
    first = kept.merge((known, beacon(App("a", "One"))))
    second = kept.merge((known, beacon(App("a", "Two"))))
    assert second.tree is first.tree
    third = kept.merge((known, beacon()))
    assert third.tree is first.tree
    assert (first.enriched, third.enriched) == (1, 0)


def test_a_layer_that_counts_for_more_now_is_merged_anew() -> None:
    node = runtime(App("a", "node"))
    known = manifest(App("a", "Name"))
    weak = attrs.evolve(known, policies=DEMOTED)
    kept = IncrementalMerge()
    assert kept.merge((node, weak)).tree.apps["a"].name == "node"
    assert kept.merge((node, known)).tree.apps["a"].name == "Name"


def test_each_entity_is_finished_once_it_is_folded() -> None:
    def shout(entity: Entity) -> Entity:
        return attrs.evolve(entity, name=entity.name.upper())

    kept = IncrementalMerge(finish=shout)
    assert kept.merge((manifest(App("a")), beacon(App("a", "name")))).tree.apps["a"].name == "NAME"
