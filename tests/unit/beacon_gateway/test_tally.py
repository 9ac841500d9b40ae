"""A gateway's counters in words: what was turned away, why, and what to do about it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.outcome import ACCEPTED, Verdict
from beacon_core.ports.examination import Finding, Level
from beacon_gateway.console import tally

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker


def told(plant: Plant, then: Callable[[], object] = lambda: None) -> list[Finding]:
    """What its counters tell, if this happens between the two looks."""
    before = plant.ok("/health")
    then()
    return list(tally.findings(before, plant.ok("/health"), plant.gateway.config.sources))


def offer(plant: Plant, payload: bytes, times: int = 1) -> None:
    for _ in range(times):
        plant.gateway.listeners[0].intake.offer(payload, "somebody")


def test_who_is_heard_is_counted(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"s": {"ttl_s": 10}})
    plant.announce("old", source="s")
    plant.wait(11)
    plant.announce("a", source="s")
    plant.announce("gone", source="s").close()
    plant.settle()
    assert told(plant) == [Finding(Level.OK, "s: 3 senders; 1 active, 1 stale, 1 left")]


def test_nothing_at_all_is_a_problem(plant: Plant) -> None:
    plant.wait(35)
    (finding,) = told(plant)
    assert finding.level is Level.PROBLEM
    assert finding.what == "robots: nothing has arrived since the gateway started 35 s ago"


def test_to_begin_with_it_is_none(plant: Plant) -> None:
    plant.wait(3)
    assert [one.level for one in told(plant)] == [Level.NOTE]


def test_silence_of_all_who_were_heard_is_a_problem(plant: Plant) -> None:
    plant.announce("a")
    plant.wait(11)
    (finding,) = told(plant)
    assert finding.level is Level.PROBLEM
    assert finding.what == "robots: 1 sender; 0 active, 1 stale, 0 left"
    assert "are they running?" in finding.advice


def test_that_all_said_goodbye_is_none(plant: Plant) -> None:
    plant.announce("a").close()
    plant.settle()
    assert [one.level for one in told(plant)] == [Level.OK]


def test_a_source_that_is_not_well_says_so_itself(plant: Plant) -> None:
    plant.announce("a")
    plant.announcer().announce(BeaconHint("late"))
    plant.clock.advance(5 * 10**9)
    finding = told(plant)[0]
    assert finding.level is Level.PROBLEM
    assert finding.what.startswith("robots: degraded: ")
    assert "deliver_due" in finding.what


def test_a_source_that_does_not_say_what_ails_it_is_named_all_the_same(plant: Plant) -> None:
    plant.announce("a")
    body = plant.ok("/health")
    body["x-medkit-beacon"]["sources"][0]["condition"] = "down"
    assert next(iter(tally.findings(body, body, ["robots"]))).what == "robots: down"


def flood(plant: Plant) -> None:
    announcer = plant.announcer("loud")
    for number in range(10):
        announcer.announce(BeaconHint("a", stable_id=str(number)))
    plant.settle()


def test_messages_above_a_rate_are_counted_with_the_key_to_change(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"source_rate": 3}})
    (heard, dropped) = told(plant, lambda: flood(plant))
    assert heard.level is Level.OK
    assert dropped == Finding(
        Level.PROBLEM,
        "robots: 7 messages dropped by source_rate, 7 of them just now",
        "raise source_rate or slow the sender: so many a second are taken from each",
    )


def test_what_was_turned_away_and_is_no_more_is_only_worth_knowing(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"global_rate": 3}})
    flood(plant)
    plant.wait(5)
    dropped = told(plant)[1]
    assert dropped.level is Level.NOTE
    assert dropped.what == "robots: 7 messages dropped by global_rate"


def test_no_room_names_the_key_to_change(make_plant: PlantMaker) -> None:
    plant = make_plant(sources={"robots": {"max_hints": 1}})
    plant.announce("a")
    found = told(plant, lambda: plant.announce("b"))
    assert "no room for another entity" in found[1].what
    assert "raise max_hints" in found[1].advice


@pytest.mark.parametrize(
    ("payload", "what"),
    [
        (b"nonsense", "rejected: no hint in this carrier's format"),
        (b'{"entity_id": "a b"}', "rejected: no entity_id, or one that the sender may not use"),
        (b" " * 300_000, "rejected as too large"),
    ],
)
def test_what_cannot_be_used_is_a_problem_while_nobody_is_heard(
    plant: Plant, payload: bytes, what: str
) -> None:
    offer(plant, payload)
    _, finding = told(plant)
    assert (finding.level, finding.what) == (Level.PROBLEM, f"robots: 1 message {what}")
    plant.announce("well")
    _, finding = told(plant)
    assert finding.level is Level.NOTE


def test_a_defect_of_a_decoder_is_to_be_reported(
    plant: Plant, monkeypatch: pytest.MonkeyPatch
) -> None:
    def defect(_: bytes) -> Any:
        raise ZeroDivisionError

    monkeypatch.setattr(plant.gateway.listeners[0].intake, "_decode", defect)
    offer(plant, b"{}")
    assert told(plant)[1].advice == "please report it"


def test_every_verdict_is_accepted_everyday_or_explained() -> None:
    everyday = {Verdict.OLDER, Verdict.BURIED, Verdict.UNKNOWN}
    explained = set(tally._TURNED_AWAY)
    groups = (set(ACCEPTED), everyday, explained)
    assert set(Verdict) == set().union(*groups)
    assert all(not one & other for one, other in itertools.combinations(groups, 2))


def test_a_conflict_is_pointed_out(plant: Plant) -> None:
    plant.announce("a", hostname="one", process_id=1)
    plant.announce("a", hostname="two", process_id=2)
    finding = told(plant)[-1]
    assert finding.level is Level.NOTE
    assert finding.what == "robots: 1 id claimed by two processes at a time"


def test_a_gateway_that_runs_with_another_configuration_is_noticed(plant: Plant) -> None:
    plant.announce("a")
    body = plant.ok("/health")
    finding = next(iter(tally.findings(body, body, ["robots", "new"])))
    assert finding == Finding(
        Level.NOTE,
        "new: the running gateway has no such source",
        "it runs with another configuration: restart it with this one",
    )


def test_a_gateway_restarted_between_the_looks_does_not_confuse(plant: Plant) -> None:
    """Then its counters are below the earlier ones, and a source may be new."""
    offer(plant, b"nonsense", times=3)
    before = plant.ok("/health")
    after = plant.ok("/health")
    after["x-medkit-beacon"]["sources"][0]["messages"]["malformed"] = 1
    found = list(tally.findings(before, after, ["robots"]))
    assert found[1].what == "robots: 1 message rejected: no hint in this carrier's format"
    before["x-medkit-beacon"]["sources"] = []
    assert list(tally.findings(before, after, ["robots"])) == found
