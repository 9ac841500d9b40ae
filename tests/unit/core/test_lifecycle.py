"""The life of a hint: the table, walked whole; and its drawing in docs/lifecycle.md.

Run this file as a script to draw it again after the table has changed.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from beacon_core.lifecycle import TRANSITIONS, Cause, Status, Transition, transition

PAGE = Path(__file__).parents[3] / "docs" / "lifecycle.md"
BEGIN, END = "<!-- drawn from the table: begin -->", "<!-- drawn from the table: end -->"
PAIRS = list(itertools.product(Status, Cause))


# -- the table -----------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", [pair for pair in PAIRS if pair in TRANSITIONS])
def test_a_pair_in_the_table_leads_where_the_table_says(pair: tuple[Status, Cause]) -> None:
    assert transition(*pair) is TRANSITIONS[pair]


@pytest.mark.parametrize("pair", [pair for pair in PAIRS if pair not in TRANSITIONS])
def test_a_pair_that_is_not_in_the_table_cannot_happen(pair: tuple[Status, Cause]) -> None:
    with pytest.raises(LookupError):
        transition(*pair)


def test_the_table_cannot_be_changed() -> None:
    with pytest.raises(TypeError):
        TRANSITIONS[Status.EXPIRED, Cause.SILENT] = Status.ACTIVE  # type: ignore[index]


@pytest.mark.parametrize("cause", Cause)
def test_every_cause_can_happen(cause: Cause) -> None:
    assert any(pair[1] is cause for pair in TRANSITIONS)


@pytest.mark.parametrize("status", Status)
def test_every_status_can_be_reached_and_left_for_good(status: Status) -> None:
    assert status in reachable(Status.EXPIRED)
    assert Status.EXPIRED in reachable(status)


@pytest.mark.parametrize("status", Status)
def test_whoever_is_heard_lives(status: Status) -> None:
    assert transition(status, Cause.HEARD) is Status.ACTIVE


@pytest.mark.parametrize("cause", [Cause.DISPLACED, Cause.LAPSED])
def test_the_active_neither_lapse_nor_give_way(cause: Cause) -> None:
    assert (Status.ACTIVE, cause) not in TRANSITIONS


def test_whoever_said_goodbye_is_neither_silent_nor_lost() -> None:
    assert (Status.LEFT, Cause.SILENT) not in TRANSITIONS
    assert (Status.LEFT, Cause.LOST) not in TRANSITIONS


def test_nothing_can_happen_to_the_expired_but_to_be_heard() -> None:
    causes = {cause for status, cause in TRANSITIONS if status is Status.EXPIRED}
    assert causes == {Cause.HEARD, Cause.HEARD_LATE}


def test_a_step_in_a_history_has_no_detail_unless_given() -> None:
    assert Transition(1, Status.STALE, Cause.SILENT).detail == ""


def reachable(status: Status) -> set[Status]:
    found: set[Status] = set()
    todo = [status]
    while todo:
        here = todo.pop()
        following = {there for (origin, _), there in TRANSITIONS.items() if origin is here}
        todo += following - found
        found |= following
    return found


# -- its drawing ---------------------------------------------------------------------------------


def test_the_drawing_in_the_documentation_is_up_to_date() -> None:
    _, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    drawn, end, _ = rest.partition(END)
    assert begin
    assert end
    assert drawn == drawing(), f"run: python {Path(__file__).relative_to(PAGE.parents[1])}"


def drawing() -> str:
    return f"\n```mermaid\nstateDiagram-v2\n{arrows()}\n```\n\n{grid()}\n"


def arrows() -> str:
    """One arrow for each pair of statuses, with every cause that leads from one to the other."""
    causes: dict[tuple[Status, Status], list[str]] = {}
    for (origin, cause), there in TRANSITIONS.items():
        causes.setdefault((origin, there), []).append(cause)
    return "\n".join(
        f"    {node(origin)} --> {node(there)}: {', '.join(names)}"
        for (origin, there), names in causes.items()
    )


def node(status: Status) -> str:
    # EXPIRED is where every life begins and ends, which Mermaid draws as dots.
    return "[*]" if status is Status.EXPIRED else status.name


def grid() -> str:
    rows = [
        ["", *(f"**{status.name}**" for status in Status)],
        ["---"] * (len(Status) + 1),
        *(
            [
                f"`{cause}`",
                *(TRANSITIONS[s, cause].name if (s, cause) in TRANSITIONS else "" for s in Status),
            ]
            for cause in Cause
        ),
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


if __name__ == "__main__":
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(before + BEGIN + drawing() + END + rest.partition(END)[2], encoding="utf-8")
