"""The mapper, whatever the hints, the tree and the order of events."""

from __future__ import annotations

import random
from typing import Any

import attrs
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from beacon_core.clock import ManualClock
from beacon_core.entities import App, Component, Entities, Function
from beacon_core.hint import BeaconHint
from beacon_core.introspection import Introspection
from beacon_core.lifecycle import Cause, Status
from beacon_core.mapper import IncrementalMapper, map_hints
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint

SECOND = 10**9
PREFIX = "x-medkit-beacon-"
STRUCTURED: dict[str, type] = {
    "status": str,
    "age-sec": float,
    "transport-type": str,
    "negotiated-format": str,
    "process-id": int,
    "process-name": str,
    "hostname": str,
    "stable-id": str,
    "depends-on": tuple,
    "functions": tuple,
}

# Few names, so that hints, apps, components and functions meet often.
ids = st.sampled_from("abcdef")
function_ids = st.sampled_from(["f", "g", "h", "a"])
texts = st.sampled_from(["", "one", "two"])
hints = st.builds(
    BeaconHint,
    entity_id=ids,
    stable_id=texts,
    display_name=texts,
    function_ids=st.lists(function_ids, max_size=4).map(tuple),
    depends_on=st.lists(ids, max_size=2).map(tuple),
    component_id=texts,
    transport_type=texts,
    process_id=st.integers(0, 2),
    metadata=st.dictionaries(st.sampled_from([*STRUCTURED, "free", "Status"]), texts, max_size=3),
)
trees = st.builds(
    Entities,
    apps=st.lists(st.builds(App, ids)),
    components=st.lists(st.builds(Component, ids)),
    functions=st.lists(st.builds(Function, function_ids, texts)),
)
allowed = st.fixed_dictionaries({"allow_new_entities": st.booleans()})
ages = st.integers(-5 * SECOND, 400 * SECOND)


@st.composite
def stored_hints(draw: st.DrawFn) -> StoredHint:
    return StoredHint(
        hint=draw(hints),
        status=draw(st.sampled_from(Status)),
        cause=Cause.HEARD,
        detail="",
        last_seen_ns=-draw(ages),
        first_seen_ns=0,
        source="",
        incarnation="",
        revision=draw(st.integers(1, 9)),
        restarts=0,
    )


snapshots = st.lists(stored_hints(), max_size=6, unique_by=lambda one: one.entity_id)


def content(result: Introspection) -> Any:
    """What is promised to be the same in whatever order hints are mapped."""
    return (
        sorted(result.new_apps, key=lambda one: one.id),
        sorted(result.new_components, key=lambda one: one.id),
        sorted((one.id, one.name, sorted(one.hosts)) for one in result.new_functions),
        {entity_id: result.metadata[entity_id] for entity_id in result.metadata},
        sorted(result.skipped),
    )


def without_ages(result: Introspection) -> Any:
    *shadows, metadata, skipped = content(result)
    for one in metadata.values():
        del one[PREFIX + "age-sec"]
    return (*shadows, metadata, skipped, result.revision)


@settings(deadline=None)
@given(snapshots, trees, allowed)
def test_every_hint_is_mapped_once_or_named_as_skipped(
    snapshot: list[StoredHint], known: Entities, options: dict[str, bool]
) -> None:
    result = map_hints(snapshot, known, 0, **options)
    present = {one.entity_id for one in snapshot if one.status is not Status.LEFT}
    apps, components = [a.id for a in result.new_apps], [c.id for c in result.new_components]
    assert sorted([*apps, *components, *result.skipped]) == sorted(present)
    assert set(result.metadata) == {*apps, *components}
    assert all(one not in known.apps for one in components)
    assert not (options["allow_new_entities"] and result.skipped)


@settings(deadline=None)
@given(snapshots, trees, allowed)
def test_a_function_is_joined_by_exactly_those_who_name_it_without_doubles(
    snapshot: list[StoredHint], known: Entities, options: dict[str, bool]
) -> None:
    result = map_hints(snapshot, known, 0, **options)
    expected: dict[str, list[str]] = {}
    for one in snapshot:
        for function_id in known.functions:
            if one.entity_id in result.metadata and function_id in one.hint.function_ids:
                expected.setdefault(function_id, []).append(one.entity_id)
    assert {one.id: list(one.hosts) for one in result.new_functions} == expected
    assert all(one.name == known.functions[one.id].name for one in result.new_functions)


@settings(deadline=None)
@given(snapshots, trees)
def test_a_structured_key_always_has_its_type(snapshot: list[StoredHint], known: Entities) -> None:
    metadata = map_hints(snapshot, known, 0, allow_new_entities=True).metadata
    for fields in metadata.values():
        assert {PREFIX + "status", PREFIX + "age-sec"} <= fields.keys()
        for key, value in fields.items():
            assert type(value) is STRUCTURED.get(key.removeprefix(PREFIX), str)


@settings(deadline=None)
@given(snapshots, trees, allowed, st.randoms(use_true_random=False))
def test_the_order_of_the_hints_changes_nothing_but_the_order(
    snapshot: list[StoredHint], known: Entities, options: dict[str, bool], chance: random.Random
) -> None:
    shuffled = chance.sample(snapshot, len(snapshot))
    first = map_hints(snapshot, known, 0, **options)
    assert content(map_hints(shuffled, known, 0, **options)) == content(first)


class MappingAgainAndAgain(RuleBasedStateMachine):
    """Any sequence of changes to store and tree: incremental mapping gives what mapping from
    scratch gives, and never touches a result it gave before.
    """

    allow_new_entities = False

    def __init__(self) -> None:
        super().__init__()
        self.clock = ManualClock()
        # A small store, so that ids give way to others too.
        self.store = HintStore(self.clock, ttl_s=10, expiry_s=60, max_hints=4)
        self.mapper = IncrementalMapper(self.store, allow_new_entities=self.allow_new_entities)
        self.known = Entities()
        self.earlier: list[tuple[Introspection, Any]] = []

    @rule(hint=hints, age_s=st.sampled_from([0, 0, 3, 12]))
    def hear(self, hint: BeaconHint, age_s: int) -> None:
        self.store.update(hint, received_at_ns=self.clock.monotonic_ns() - age_s * SECOND)

    @rule(hint=hints, source=st.sampled_from("st"), incarnation=st.sampled_from("12"))
    def hear_from(self, hint: BeaconHint, source: str, incarnation: str) -> None:
        self.store.update(hint, source=source, incarnation=incarnation)

    @rule(entity_id=ids, source=st.sampled_from(["", "s", "t"]))
    def say_goodbye(self, entity_id: str, source: str) -> None:
        self.store.goodbye(entity_id, source=source, incarnation="1" if source else "")

    @rule(entity_id=ids, source=st.sampled_from(["", "s", "t"]))
    def lose(self, entity_id: str, source: str) -> None:
        self.store.lost(entity_id, source=source, incarnation="1" if source else "")

    @rule(entity_id=ids | st.none())
    def forget(self, entity_id: str | None) -> None:
        self.store.forget(entity_id)

    @rule(seconds=st.sampled_from([1, 5, 10, 60]))
    def wait(self, seconds: int) -> None:
        self.clock.advance(seconds * SECOND)

    @rule(known=trees)
    def change_the_tree(self, known: Entities) -> None:
        self.known = known

    @rule(apps=st.lists(st.builds(App, ids)))
    def change_the_apps(self, apps: list[App]) -> None:
        self.known = attrs.evolve(self.known, apps=apps)

    @rule()
    def introspect(self) -> None:
        result = self.mapper.introspect(self.known)
        scratch = map_hints(
            self.store.snapshot(),
            self.known,
            self.clock.monotonic_ns(),
            allow_new_entities=self.allow_new_entities,
        )
        assert content(result) == content(scratch)
        assert result.revision == self.store.revision
        self.earlier.append((result, without_ages(result)))

    @invariant()
    def earlier_results_stay_as_they_were(self) -> None:
        for result, before in self.earlier[-3:]:
            assert without_ages(result) == before
            assert all(
                float(one[PREFIX + "age-sec"]) >= 0  # type: ignore[arg-type]
                for one in result.metadata.values()
            )


class MappingWithNewEntities(MappingAgainAndAgain):
    allow_new_entities = True


STEPS = settings(stateful_step_count=40, deadline=None)
MappingAgainAndAgain.TestCase.settings = settings(STEPS, max_examples=150)
MappingWithNewEntities.TestCase.settings = settings(STEPS, max_examples=50)
TestMappingAgainAndAgain = MappingAgainAndAgain.TestCase
TestMappingWithNewEntities = MappingWithNewEntities.TestCase
