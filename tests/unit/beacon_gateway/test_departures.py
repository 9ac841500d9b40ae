"""Who went last: told by the carriers, kept in short, and in force while an older view is left."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.intake import Intake
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint
from beacon_core.wire import json
from beacon_gateway import departures as module
from beacon_gateway.departures import Departures, Witness
from beacon_gateway.views import View

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

S = 1_000_000_000


def departure(
    entity_id: str = "a", at_ns: int = 5, source: str = "fast", **words: str | int
) -> View:
    left = Transition(at_ns, Status.LEFT, Cause.GOODBYE)
    stored = StoredHint(
        hint=BeaconHint(entity_id, **words),  # type: ignore[arg-type]
        status=Status.LEFT,
        cause=Cause.GOODBYE,
        detail="",
        last_seen_ns=at_ns - 1,
        first_seen_ns=0,
        source="s",
        incarnation="i",
        revision=1,
        restarts=0,
        history=(Transition(0, Status.ACTIVE, Cause.HEARD), left),
    )
    return View(source, "fake", stored)


# -- kept ----------------------------------------------------------------------------------------


def test_the_newest_departure_of_an_entity_is_kept_whichever_is_told_last() -> None:
    older, newer = departure(at_ns=5), departure(at_ns=6, source="slow")
    for order in ([older, newer], [newer, older]):
        departures = Departures(10)
        for view in order:
            departures.note(view)
        last = departures.last("a")
        assert last is not None
        assert (last.source, len(departures)) == ("slow", 1)
    assert departures.last("b") is None


def test_of_its_words_is_kept_who_it_was() -> None:
    departures = Departures(10)
    departures.note(
        departure(display_name="A", hostname="h", process_id=7, stable_id="s", transport_type="t")
    )
    last = departures.last("a")
    assert last is not None
    assert last.stored.hint == BeaconHint("a", display_name="A", hostname="h", process_id=7)
    assert [step.cause for step in last.stored.history] == [Cause.GOODBYE]


@pytest.mark.parametrize(
    ("most", "kept"), [(0, []), (1, ["c"]), (2, ["b", "c"]), (3, ["a", "b", "c"])]
)
def test_the_one_noted_first_gives_way(most: int, kept: list[str]) -> None:
    departures = Departures(most)
    for name in "cabc":
        departures.note(departure(name))
    assert [name for name in "abc" if departures.last(name)] == kept


def test_large_ones_give_way_earlier(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_DEPARTURES_BYTES", 5_000)
    departures = Departures(1_000)
    for number in range(100):
        departures.note(departure(f"a{number}", display_name="x" * 500))
        departures.note(departure("again", at_ns=number))
    assert len(departures) == 4
    assert departures.last("a99") is not None
    assert departures.last("again") is not None


# -- told ----------------------------------------------------------------------------------------


@pytest.fixture
def noted() -> list[StoredHint]:
    return []


@pytest.fixture
def sink(noted: list[StoredHint]) -> Witness:
    store = HintStore(ManualClock())
    return Witness(Intake(store, json.decode), store, noted.append)


def hear(sink: Witness, entity_id: str, source: str, incarnation: str, host: str) -> None:
    payload = json.encode(BeaconHint(entity_id, hostname=host))
    assert sink.offer(payload, source, incarnation=incarnation, sequence=1).accepted


def test_what_a_carrier_tells_goes_through_and_departures_are_noted(
    sink: Witness, noted: list[StoredHint]
) -> None:
    hear(sink, "a", "r1", "i", "h")
    hear(sink, "b", "r1", "i", "h")
    left = sink.goodbye("a", "r1", incarnation="i", sequence=2)
    assert left.verdict is Verdict.LEFT
    lost = sink.lost("b", "r1", incarnation="i", reason="cable cut")
    assert lost.verdict is Verdict.LOST
    assert [(one.entity_id, one.cause, one.detail) for one in noted] == [
        ("a", Cause.GOODBYE, ""),
        ("b", Cause.LOST, "cable cut"),
    ]


def test_a_departure_that_changes_nothing_is_none(sink: Witness, noted: list[StoredHint]) -> None:
    hear(sink, "a", "r1", "i", "h")
    assert sink.goodbye("a", "r1", incarnation="i", sequence=1).verdict is Verdict.OLDER
    assert sink.lost("nobody", "r1").verdict is Verdict.UNKNOWN
    assert noted == []


def test_the_departure_of_a_rival_is_not_that_of_the_entity(
    sink: Witness, noted: list[StoredHint]
) -> None:
    hear(sink, "a", "r1", "i", "h")
    hear(sink, "a", "r2", "j", "g")
    assert sink.goodbye("a", "r2", incarnation="j").verdict is Verdict.LEFT
    assert noted == []


# -- in force ------------------------------------------------------------------------------------


@pytest.fixture
def two(make_plant: PlantMaker) -> Plant:
    """A source that forgets quickly, and one that believes for long."""
    return make_plant(
        sources={"fast": {"ttl_s": 1, "expiry_s": 20}, "slow": {"ttl_s": 100, "expiry_s": 300}}
    )


def seen(plant: Plant) -> tuple[str, str] | None:
    beacon = plant.gateway.directory.beacon("a")
    return None if beacon is None else (beacon.status.value, beacon.freshest.source)


def test_a_goodbye_outlives_the_tombstone_while_another_source_believes_in_it(two: Plant) -> None:
    two.announce("a", source="slow")
    robot = two.announce("a", source="fast")
    robot.close()
    two.settle()
    assert seen(two) == ("left", "fast")
    for _ in range(30):
        two.wait(10)
        two.gateway.listeners[0].store.sweep()
        if seen(two) is None:
            break
        assert seen(two) == ("left", "fast")
        (app,) = two.ok("/apps")["items"]
        assert (app["x-medkit"]["is_online"], app["x-medkit"]["beacon"]["status"]) == (
            False,
            "left",
        )
    # Until the other one has forgotten it too.
    assert two.gateway.listeners[1].store.get("a") is None
    assert two.ok("/apps")["items"] == []


def test_a_loss_outlives_its_record_too(two: Plant) -> None:
    two.announce("a", source="slow")
    robot = two.announce("a", source="fast")
    two.networks["fast"].crash(robot.name)
    two.wait(5)
    assert seen(two) == ("stale", "fast")
    two.wait(40)
    assert two.gateway.listeners[0].store.get("a") is None
    assert seen(two) == ("stale", "fast")


def test_whoever_is_heard_since_is_back(two: Plant) -> None:
    robot = two.announce("a", source="slow")
    two.announce("a", source="fast").close()
    two.settle()
    two.wait(30)
    assert seen(two) == ("left", "fast")
    robot.announce(BeaconHint("a", display_name="A"))
    two.settle()
    assert seen(two) == ("active", "slow")


def test_with_one_source_a_goodbye_is_forgotten_after_its_time(plant: Plant) -> None:
    plant.announce("a").close()
    plant.settle()
    assert seen(plant) == ("left", "robots")
    plant.wait(11)
    assert seen(plant) is None
