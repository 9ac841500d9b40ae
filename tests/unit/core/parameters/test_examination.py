"""Somebody whose view is empty is told who is silent, who declares what, and what is wrong."""

from __future__ import annotations

import pytest

from beacon_core.parameters.examination import Declared, declarations
from beacon_core.parameters.fields import ENTITY_ID, PREFIX
from beacon_core.ports.examination import Level


def told(answers: dict[str, Declared | None]) -> list[tuple[Level, str]]:
    return [(one.level, one.what) for one in declarations(answers, 2.0)]


def test_who_declares_a_hint_is_named_with_its_entity() -> None:
    assert told({"/engine": {ENTITY_ID: "engine"}, "/plain": {}}) == [
        (Level.OK, f"{PREFIX}.* is declared by /engine (engine)")
    ]


def test_who_does_not_answer_is_named() -> None:
    assert told({"/engine": None}) == [
        (Level.PROBLEM, "no answer to list_parameters or get_parameters in 2 s: /engine")
    ]


def test_where_nobody_declares_anything_that_is_the_problem() -> None:
    assert told({"/plain": {}}) == [(Level.PROBLEM, f"no node declares {PREFIX}.*")]


@pytest.mark.parametrize(
    ("declared", "fault"),
    [
        ({f"{PREFIX}.hostname": "robot"}, "not entity_id among them"),
        ({ENTITY_ID: None}, "entity_id is no text but not set"),
        ({ENTITY_ID: 7}, "entity_id is no text but of type int"),
        ({ENTITY_ID: ""}, "entity_id is empty"),
        ({ENTITY_ID: "no id!"}, "entity_id is no id: 1 to 256 of A-Z a-z 0-9 _ -"),
    ],
)
def test_a_hint_that_is_none_is_a_problem(declared: Declared, fault: str) -> None:
    assert told({"/engine": declared}) == [
        (Level.PROBLEM, f"/engine declares {PREFIX}.*, but {fault}")
    ]


def test_of_many_faults_a_few_are_told() -> None:
    findings = told({f"/n{number}": {ENTITY_ID: ""} for number in range(7)})
    assert len(findings) == 6
    assert findings[-1] == (Level.PROBLEM, "so it is with 2 more nodes")


def test_what_cannot_be_used_besides_is_a_note() -> None:
    bad = {ENTITY_ID: "engine", f"{PREFIX}.colour": "blue", f"{PREFIX}.process_id": "x"}
    (_, note) = told({"/engine": bad})
    assert note[0] is Level.NOTE
    assert note[1].startswith("of /engine is left out: ")
    assert note[1].endswith("(and 1 more)")
    (_, note) = told({"/engine": {ENTITY_ID: "engine", f"{PREFIX}.colour": "blue"}})
    assert not note[1].endswith("more)")


def test_of_many_names_the_first_are_told() -> None:
    ((_, what),) = told(dict.fromkeys("abcdefg"))
    assert what.endswith(": a, b, c, d, e and 2 more")
