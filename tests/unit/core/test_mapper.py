"""The mapper: every case of the C++ system, and what incremental mapping promises besides."""

from __future__ import annotations

import json
import logging
import threading
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core import mapper
from beacon_core.clock import ManualClock
from beacon_core.entities import App, Component, Entities, Function
from beacon_core.hint import BeaconHint
from beacon_core.introspection import Introspection
from beacon_core.lifecycle import Cause, Status
from beacon_core.limits import MAX_REMOVED
from beacon_core.mapper import IncrementalMapper, map_hints
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint
from beacon_core.testing.examples import BENCH_HINT, bench_hint

VECTORS = Path(__file__).parents[2] / "data" / "vectors" / "mapper.jsonl"
PREFIX = "x-medkit-beacon-"
SECOND = 10**9
NOW_NS = 10**15


def stored(hint: BeaconHint, status: Status = Status.ACTIVE, age_ns: int = 0) -> StoredHint:
    return StoredHint(
        hint=hint,
        status=status,
        cause=Cause.HEARD,
        detail="",
        last_seen_ns=NOW_NS - age_ns,
        first_seen_ns=0,
        source="",
        incarnation="",
        revision=1,
        restarts=0,
    )


# -- from scratch: the C++ system's cases --------------------------------------------------------


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=f"{case['n']}")
        for case in map(json.loads, VECTORS.read_text(encoding="utf-8").splitlines())
    ],
)
def test_hints_map_as_in_the_cpp_system(case: dict[str, Any]) -> None:
    result = map_hints(
        map(vector_hint, case["hints"]),
        vector_entities(case["current"]),
        NOW_NS,
        allow_new_entities=case["allow_new_entities"],
    )
    assert as_vector(result) == with_reserved_keys(case)


def with_reserved_keys(case: dict[str, Any]) -> Any:
    """The one difference on purpose: there, free metadata took the place of a structured key
    that was not given, and with it went the JSON type behind that key. Here the ten structured
    keys are always reserved.
    """
    field_of = {
        "transport-type": "transport_type",
        "negotiated-format": "negotiated_format",
        "process-id": "process_id",
        "process-name": "process_name",
        "hostname": "hostname",
        "stable-id": "stable_id",
        "depends-on": "depends_on",
        "functions": "function_ids",
    }
    for hint in case["hints"]:
        for key in hint.get("metadata", {}).keys() & field_of.keys():
            if not hint.get(field_of[key]):
                case["result"]["metadata"].get(hint["entity_id"], {}).pop(PREFIX + key, None)
    return case["result"]


def vector_hint(given: dict[str, Any]) -> StoredHint:
    fields: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in given.items()
    }
    del fields["age_sec"]
    status, age_ns = Status(fields.pop("status")), fields.pop("age_ns")
    return stored(BeaconHint(**fields), status, age_ns)


def vector_entities(current: dict[str, Any]) -> Entities:
    return Entities(
        apps=[App(**app) for app in current["apps"]],
        components=[Component(**component) for component in current["components"]],
        functions=[
            Function(one["id"], one["name"], tuple(one["hosts"])) for one in current["functions"]
        ],
    )


def as_vector(result: Introspection) -> Any:
    return json.loads(
        json.dumps(
            {
                "metadata": dict(result.metadata),
                "new_entities": {
                    "areas": [],
                    "apps": [attrs.asdict(app) for app in result.new_apps],
                    "components": [attrs.asdict(one) for one in result.new_components],
                    "functions": [attrs.asdict(one) for one in result.new_functions],
                },
            }
        )
    )


# -- from scratch: the rest ----------------------------------------------------------------------


def test_those_who_left_are_not_mapped() -> None:
    known = Entities(apps=[App("a")], functions=[Function("f")])
    left = stored(BeaconHint("a", function_ids=("f",)), Status.LEFT)
    result = map_hints([left], known, NOW_NS)
    assert (result.new_apps, result.new_functions, dict(result.metadata)) == ((), (), {})
    assert result.skipped == ()


def test_hints_about_nobody_known_are_named_once_and_host_nothing() -> None:
    known = Entities(functions=[Function("f")])
    hints = [stored(BeaconHint("u", function_ids=("f",))), stored(BeaconHint("u"))]
    result = map_hints(hints, known, NOW_NS)
    assert result.skipped == ("u",)
    assert (result.new_apps, result.new_functions, dict(result.metadata)) == ((), (), {})


def test_from_scratch_tells_the_latest_revision_among_the_hints() -> None:
    hints = [attrs.evolve(stored(bench_hint(n)), revision=n) for n in (1, 3, 2)]
    assert map_hints(hints, Entities(), NOW_NS).revision == 3
    assert map_hints([], Entities(), NOW_NS).revision == 0


def test_from_scratch_ages_stay_as_they_are() -> None:
    known = Entities(apps=[App("a")])
    result = map_hints([stored(BeaconHint("a"), age_ns=-2500 * 10**6)], known, NOW_NS)
    assert result.metadata["a"][PREFIX + "age-sec"] == -2.5


class Counted(str):
    """An id that counts how often it is hashed or compared: what a look-up costs."""

    looks = 0
    __slots__ = ()

    def __hash__(self) -> int:
        Counted.looks += 1
        return super().__hash__()

    def __eq__(self, other: object) -> bool:
        Counted.looks += 1
        return super().__eq__(other)


def counted_hints(count: int) -> list[StoredHint]:
    ids = [Counted(f"e{n}") for n in range(count)]
    functions = [Counted(f"f{n}") for n in range(10)]
    return [
        stored(BeaconHint(ids[n], function_ids=(functions[n % 10], functions[(n * 7) % 10])))
        for n in range(count)
    ]


def test_the_cost_from_scratch_is_linear() -> None:
    def looks(count: int) -> int:
        hints = counted_hints(count)
        known = Entities(
            apps=[App(one.entity_id) for one in hints],
            functions=[Function(f"f{n}") for n in range(10)],
        )
        Counted.looks = 0
        assert len(map_hints(hints, known, NOW_NS).new_apps) == count
        return Counted.looks

    # A few comparisons per thousand are chance collisions in dicts.
    assert looks(4000) < 4.2 * looks(1000)


# -- incremental ---------------------------------------------------------------------------------


class House:
    """A store on a clock of its own, and a mapper over it."""

    def __init__(self, *, allow_new_entities: bool = False) -> None:
        self.clock = ManualClock()
        self.store = HintStore(self.clock, ttl_s=10, expiry_s=300)
        self.allow_new_entities = allow_new_entities
        self.mapper = IncrementalMapper(self.store, allow_new_entities=allow_new_entities)

    def hear(self, *hints: BeaconHint) -> None:
        for hint in hints:
            self.store.update(hint)

    def map(self, known: Entities) -> Introspection:
        """Introspect, and see that it is what mapping from scratch gives."""
        result = self.mapper.introspect(known)
        scratch = map_hints(
            self.store.snapshot(),
            known,
            self.clock.monotonic_ns(),
            allow_new_entities=self.allow_new_entities,
        )
        assert content(result) == content(scratch)
        return result


def content(result: Introspection) -> Any:
    """What is promised to be the same in whatever order hints are mapped."""
    return (
        sorted(result.new_apps, key=lambda one: one.id),
        sorted(result.new_components, key=lambda one: one.id),
        sorted((one.id, one.name, *sorted(one.hosts)) for one in result.new_functions),
        dict(result.metadata),
        sorted(result.skipped),
    )


@pytest.fixture
def house() -> House:
    return House()


A, B = BeaconHint("a", "sa", "App A", ("f",), process_id=1), BeaconHint("b", display_name="App B")
KNOWN = Entities(
    apps=[App("a"), App("b")], components=[Component("c")], functions=[Function("f", "Func f")]
)


def test_the_first_time_gives_what_mapping_from_scratch_gives_also_in_order(house: House) -> None:
    house.hear(B, A, BeaconHint("c"), BeaconHint("u"))
    result = house.map(KNOWN)
    scratch = map_hints(house.store.snapshot(), KNOWN, house.clock.monotonic_ns())
    assert result == scratch
    assert result.revision == house.store.revision == 4


def test_nothing_heard_gives_nothing(house: House) -> None:
    result = house.map(KNOWN)
    assert (result.revision, len(result.metadata)) == (0, 0)
    assert (result.new_apps, result.new_components, result.new_functions) == ((), (), ())


def test_when_nothing_changed_the_parts_are_the_same_objects(house: House) -> None:
    house.hear(A, B, BeaconHint("c"), BeaconHint("u"))
    first = house.map(KNOWN)
    house.clock.advance(SECOND)
    house.hear(A)
    second = house.map(KNOWN)
    assert second.revision == first.revision
    assert second.new_apps is first.new_apps
    assert second.new_components is first.new_components
    assert second.new_functions is first.new_functions
    assert second.skipped is first.skipped


def test_an_unchanged_entity_is_not_looked_at() -> None:
    house = House()
    ids = [Counted(f"e{n}") for n in range(1000)]
    house.hear(*(BeaconHint(one, function_ids=("f",)) for one in ids))
    known = Entities(apps=[App(one) for one in ids], functions=[Function("f")])
    house.mapper.introspect(known)
    house.hear(*(BeaconHint(one) for one in ids))
    house.hear(BeaconHint("e7", display_name="Seven"))
    Counted.looks = 0
    result = house.mapper.introspect(known)
    # Each dict look-up of the changed one compares it with its stored, counted key.
    assert Counted.looks < 20
    assert App("e7", "Seven") in result.new_apps


def test_a_refresh_shows_in_the_age_alone(house: House) -> None:
    house.hear(A, B)
    house.map(KNOWN)
    house.clock.advance(4 * SECOND)
    house.hear(A)
    house.clock.advance(SECOND)
    metadata = house.map(KNOWN).metadata
    assert metadata["a"][PREFIX + "age-sec"] == 1.0
    assert metadata["b"][PREFIX + "age-sec"] == 5.0


def test_an_age_is_never_below_zero_when_a_refresh_landed_later(house: House) -> None:
    house.hear(A)
    result = house.map(KNOWN)
    house.clock.advance(3 * SECOND)
    house.hear(A)
    assert result.metadata["a"][PREFIX + "age-sec"] == 0.0


def test_the_age_outlives_the_record(house: House) -> None:
    house.hear(A)
    house.clock.advance(SECOND)
    result = house.map(KNOWN)
    house.store.forget()
    assert result.metadata["a"][PREFIX + "age-sec"] == 1.0


def test_a_change_is_mapped_in_its_place(house: House) -> None:
    house.hear(A, B)
    house.map(KNOWN)
    house.hear(attrs.evolve(A, display_name="Better", metadata={"k": "v"}))
    result = house.map(KNOWN)
    assert result.new_apps == (App("a", "Better"), App("b", "App B"))
    assert result.metadata["a"][PREFIX + "k"] == "v"


def test_silence_makes_it_stale_and_more_silence_ends_it(house: House) -> None:
    house.hear(A)
    assert house.map(KNOWN).metadata["a"][PREFIX + "status"] == "active"
    house.clock.advance(10 * SECOND)
    assert house.map(KNOWN).metadata["a"][PREFIX + "status"] == "stale"
    house.clock.advance(290 * SECOND)
    ended = house.map(KNOWN)
    assert (ended.new_apps, ended.new_functions, dict(ended.metadata)) == ((), (), {})


def test_a_loss_shows_as_stale_at_once(house: House) -> None:
    house.hear(A)
    house.map(KNOWN)
    house.store.lost("a")
    assert house.map(KNOWN).metadata["a"][PREFIX + "status"] == "stale"


def test_a_goodbye_takes_it_away_and_a_new_life_brings_it_back(house: House) -> None:
    house.store.update(A, source="s", incarnation="1")
    house.hear(B)
    house.map(KNOWN)
    house.store.goodbye("a", source="s", incarnation="1")
    assert house.map(KNOWN).new_apps == (App("b", "App B"),)
    house.clock.advance(SECOND)
    house.store.update(A, source="s", incarnation="2")
    assert house.map(KNOWN).new_apps == (App("b", "App B"), App("a", "App A"))


def test_those_who_left_before_the_first_time_are_not_mapped(house: House) -> None:
    house.hear(A)
    house.store.goodbye("a")
    assert house.map(KNOWN).new_apps == ()


def test_function_membership_follows_the_hint(house: House) -> None:
    known = attrs.evolve(KNOWN, functions=[Function("f", "F"), Function("g", "G"), Function("h")])
    house.hear(attrs.evolve(A, function_ids=("f", "g", "f")), attrs.evolve(B, function_ids=("g",)))
    assert house.map(known).new_functions == (
        Function("f", "F", ("a",)),
        Function("g", "G", ("a", "b")),
    )
    house.hear(attrs.evolve(A, function_ids=("h", "g")))
    assert house.map(known).new_functions == (
        Function("g", "G", ("a", "b")),
        Function("h", "", ("a",)),
    )


def test_functions_that_lose_nobody_are_kept_as_they_are(house: House) -> None:
    house.hear(A)
    first = house.map(KNOWN)
    house.hear(attrs.evolve(A, display_name="Other"))
    assert house.map(KNOWN).new_functions is first.new_functions


def test_a_function_that_appears_finds_its_hosts(house: House) -> None:
    house.hear(A)
    assert house.map(attrs.evolve(KNOWN, functions=())).new_functions == ()
    assert house.map(KNOWN).new_functions == (Function("f", "Func f", ("a",)),)


def test_a_function_that_is_renamed_or_vanishes_is_followed(house: House) -> None:
    house.hear(A)
    house.map(KNOWN)
    renamed = attrs.evolve(KNOWN, functions=[Function("f", "New")])
    assert house.map(renamed).new_functions == (Function("f", "New", ("a",)),)
    assert house.map(attrs.evolve(KNOWN, functions=())).new_functions == ()


def test_an_entity_that_becomes_known_is_mapped_and_one_that_vanishes_is_skipped(
    house: House,
) -> None:
    house.hear(A, B)
    only_a = attrs.evolve(KNOWN, apps=[App("a")])
    assert house.map(only_a).skipped == ("b",)
    assert house.map(KNOWN).skipped == ()
    assert house.map(attrs.evolve(KNOWN, apps=[App("b")])).skipped == ("a",)


def test_an_entity_that_changes_its_kind_is_mapped_anew(house: House) -> None:
    house.hear(A)
    house.map(KNOWN)
    result = house.map(attrs.evolve(KNOWN, apps=(), components=[Component("a")]))
    assert (result.new_apps, result.new_components) == ((), (Component("a", "App A"),))


def test_an_equal_tree_in_another_object_maps_nothing_again(house: House) -> None:
    house.hear(A, B)
    first = house.map(KNOWN)
    second = house.map(attrs.evolve(KNOWN))
    assert second.new_apps is first.new_apps
    assert second.new_functions is first.new_functions


def test_new_entities_are_made_where_they_are_allowed() -> None:
    house = House(allow_new_entities=True)
    house.hear(attrs.evolve(A, component_id="c"))
    result = house.map(Entities())
    assert result.new_apps == (App("a", "App A", "c", source="beacon"),)
    assert house.map(KNOWN).new_apps == (App("a", "App A", "c"),)


def test_a_mapper_left_far_behind_starts_again(house: House) -> None:
    house.hear(A, B)
    house.map(KNOWN)
    house.store.forget("a")
    for _ in range(MAX_REMOVED):
        house.hear(BeaconHint("passing"))
        house.store.forget("passing")
    assert house.store.changes_since(2).too_old
    assert house.map(KNOWN).new_apps == (App("b", "App B"),)


def test_nothing_is_remembered_of_those_who_are_gone(house: House) -> None:
    for n in range(100):
        house.hear(BeaconHint("a", function_ids=(f"f{n}", "f")), BeaconHint(f"u{n}"))
        house.map(KNOWN)
        house.store.forget()
    house.map(KNOWN)
    held = house.mapper
    assert not held._hints
    assert not held._prepared
    assert not held._members._hosts
    assert not held._members._named
    assert not held._members.changed


def test_results_handed_out_earlier_do_not_change(house: House) -> None:
    house.hear(A, B)
    first = house.map(KNOWN)
    before = content(first)
    house.hear(attrs.evolve(A, display_name="Other", function_ids=("none",)), BeaconHint("c"))
    house.store.forget("b")
    house.map(KNOWN)
    house.map(Entities())
    assert content(first) == before


def test_calls_from_several_threads_give_consistent_results(house: House) -> None:
    known = Entities(apps=[App(f"e{n}") for n in range(50)], functions=[Function("f")])
    faults: list[Introspection] = []
    done = threading.Event()

    def read() -> None:
        while not done.is_set():
            result = house.mapper.introspect(known)
            apps = {app.id for app in result.new_apps}
            hosts = set(result.new_functions[0].hosts) if result.new_functions else set()
            if apps != hosts or apps != set(result.metadata):
                faults.append(result)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for n in range(2000):
        house.hear(BeaconHint(f"e{n % 50}", function_ids=("f",), process_id=n))
        house.store.forget(f"e{n * 7 % 50}")
    done.set()
    for reader in readers:
        reader.join()
    assert not faults
    house.map(known)


# -- the log -------------------------------------------------------------------------------------


def test_a_skipped_entity_is_logged_once(house: House, caplog: pytest.LogCaptureFixture) -> None:
    house.hear(BeaconHint("u"), BeaconHint("v"), A)
    house.map(KNOWN)
    house.map(KNOWN)
    house.hear(BeaconHint("u", display_name="says more"))
    assert house.map(KNOWN).skipped == ("u", "v")
    assert [record.levelno for record in caplog.records] == [logging.WARNING] * 2
    assert [record.getMessage() for record in caplog.records] == [
        "'u' is no known app or component: its hint is skipped",
        "'v' is no known app or component: its hint is skipped",
    ]


def test_one_that_comes_back_is_not_logged_again(
    house: House, caplog: pytest.LogCaptureFixture
) -> None:
    house.hear(BeaconHint("u"))
    house.map(KNOWN)
    house.store.forget("u")
    house.map(KNOWN)
    house.hear(BeaconHint("u"))
    house.map(KNOWN)
    assert len(caplog.records) == 1


def test_invented_names_fill_neither_log_nor_memory(
    house: House, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mapper, "MAX_SKIPS_LOGGED", 5)
    house.hear(*(BeaconHint(f"u{n}") for n in range(4)))
    house.map(KNOWN)
    house.hear(*(BeaconHint(f"v{n}") for n in range(4)))
    house.map(KNOWN)
    house.hear(BeaconHint("w"))
    assert len(house.map(KNOWN).skipped) == 9
    assert len(caplog.records) == len(house.mapper._logged) == 5


def test_an_id_that_no_validator_saw_is_escaped_and_cut_in_the_log(
    house: House, caplog: pytest.LogCaptureFixture
) -> None:
    house.hear(BeaconHint("\x1b[31m\n" + "x" * 10_000))
    house.map(KNOWN)
    message = caplog.records[0].getMessage()
    assert message.isprintable()
    assert len(message) < 200


def test_the_bench_hint_maps_whole(house: House) -> None:
    house.hear(BENCH_HINT)
    known = Entities(apps=[App(BENCH_HINT.entity_id)], functions=[Function("thermal", "T")])
    result = house.map(known)
    assert result.new_functions == (Function("thermal", "T", (BENCH_HINT.entity_id,)),)
    assert len(result.metadata[BENCH_HINT.entity_id]) == 12
