"""Several sources' views of one entity: which is the freshest, and when they contradict."""

from __future__ import annotations

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.stored import Claim, StoredHint
from beacon_gateway.views import Beacon, View, with_departure

STATUS = {
    Cause.HEARD: Status.ACTIVE,
    Cause.HEARD_LATE: Status.STALE,
    Cause.SILENT: Status.STALE,
    Cause.LOST: Status.STALE,
    Cause.GOODBYE: Status.LEFT,
}


def view(source: str, cause: Cause, heard_ns: int, ended_ns: int = 0, **fields: str | int) -> View:
    hint = attrs.evolve(BeaconHint("a"), **fields)  # type: ignore[arg-type]
    status = STATUS[cause]
    history = (Transition(ended_ns, status, cause),) if ended_ns else ()
    stored = StoredHint(
        hint=hint,
        status=status,
        cause=cause,
        detail="",
        last_seen_ns=heard_ns,
        first_seen_ns=0,
        source=f"sender of {source}",
        incarnation="",
        revision=1,
        restarts=0,
        history=history,
    )
    return View(source, "fake", stored)


def order(*views: View) -> list[str]:
    beacon = Beacon.of(views)
    assert beacon is not None
    assert beacon.freshest is beacon.views[0]
    assert beacon.stored is beacon.views[0].stored
    return [one.source for one in beacon.views]


def test_without_a_view_there_is_no_beacon() -> None:
    assert Beacon.of([]) is None


def test_the_one_heard_last_is_the_freshest() -> None:
    old, new = view("old", Cause.HEARD, 10), view("new", Cause.HEARD, 20)
    assert order(old, new) == order(new, old) == ["new", "old"]


def test_a_goodbye_is_as_fresh_as_when_it_was_said() -> None:
    left = view("left", Cause.GOODBYE, 10, ended_ns=25)
    assert order(view("heard", Cause.HEARD, 20), left) == ["left", "heard"]
    assert order(view("heard", Cause.HEARD, 30), left) == ["heard", "left"]


def test_a_loss_is_as_fresh_as_when_it_was_seen() -> None:
    lost = view("lost", Cause.LOST, 10, ended_ns=25)
    assert order(view("heard", Cause.HEARD, 20), lost) == ["lost", "heard"]
    assert order(view("heard", Cause.HEARD, 30), lost) == ["heard", "lost"]


def test_silence_is_no_evidence_while_another_source_has_any() -> None:
    silent = view("silent", Cause.SILENT, 50, ended_ns=60)
    late = view("late", Cause.HEARD_LATE, 40)
    heard = view("heard", Cause.HEARD, 20)
    left = view("left", Cause.GOODBYE, 5, ended_ns=6)
    assert order(silent, heard, left, late) == ["heard", "left", "silent", "late"]


def names(*views: View, departure: View | None) -> list[str]:
    return [one.source for one in with_departure(views, departure)]


def test_a_departure_that_its_source_has_forgotten_outweighs_older_views() -> None:
    left = view("left", Cause.GOODBYE, 10, ended_ns=25)
    older = [view("heard", Cause.HEARD, 25), view("silent", Cause.SILENT, 20)]
    assert names(*older, departure=left) == ["heard", "silent", "left"]
    assert order(*with_departure(older, left)) == ["left", "heard", "silent"]
    lost = view("lost", Cause.LOST, 10, ended_ns=26)
    assert order(*with_departure(older, lost))[0] == "lost"


@pytest.mark.parametrize("cause", [Cause.HEARD, Cause.SILENT])
def test_a_departure_says_nothing_once_the_entity_was_heard_since(cause: Cause) -> None:
    left = view("left", Cause.GOODBYE, 10, ended_ns=25)
    views = [view("old", Cause.HEARD, 20), view("new", cause, 26)]
    assert names(*views, departure=left) == ["old", "new"]


def test_a_departure_is_not_told_beside_what_its_source_says_now_nor_alone() -> None:
    left = view("left", Cause.GOODBYE, 10, ended_ns=25)
    assert names(view("left", Cause.HEARD, 5), departure=left) == ["left"]
    assert names(departure=left) == []
    assert names(view("heard", Cause.HEARD, 20), departure=None) == ["heard"]


def test_only_an_active_one_is_online() -> None:
    for cause, status in STATUS.items():
        beacon = Beacon.of([view("a", cause, 1, ended_ns=1)])
        assert beacon is not None
        assert beacon.status is status
        assert beacon.online is (status is Status.ACTIVE)


def conflict(*views: View) -> bool:
    beacon = Beacon.of(views)
    assert beacon is not None
    return beacon.conflict


def test_two_sources_that_name_two_processes_are_in_conflict() -> None:
    one = view("one", Cause.HEARD, 1, hostname="h", process_id=1)
    other_pid = view("other", Cause.HEARD, 2, hostname="h", process_id=2)
    other_host = view("other", Cause.HEARD, 2, hostname="i", process_id=1)
    assert conflict(one, other_pid)
    assert conflict(one, other_host)
    beacon = Beacon.of([one, other_pid])
    assert beacon is not None
    assert [claim.hint.process_id for claim in beacon.claims] == [2, 1]


def test_two_sources_that_may_mean_the_same_process_are_not() -> None:
    one = view("one", Cause.HEARD, 1, hostname="h", process_id=1)
    for other in (
        view("other", Cause.HEARD, 2, hostname="h", process_id=1),
        view("other", Cause.HEARD, 2),
        view("other", Cause.HEARD, 2, hostname="h"),
        view("other", Cause.HEARD, 2, process_id=1),
        view("other", Cause.SILENT, 2, hostname="i", process_id=2),
        view("other", Cause.GOODBYE, 2, ended_ns=2, hostname="i", process_id=2),
    ):
        assert not conflict(one, other)


def test_a_conflict_within_one_source_is_one_of_all() -> None:
    torn = view("torn", Cause.HEARD, 1)
    claim = Claim(torn.stored.hint, "s", "", 1)
    torn = attrs.evolve(torn, stored=attrs.evolve(torn.stored, claims=(claim, claim)))
    beacon = Beacon.of([torn, view("fresh", Cause.HEARD, 2)])
    assert beacon is not None
    assert beacon.claims == (claim, claim)
