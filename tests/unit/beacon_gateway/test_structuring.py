"""Plain data into attrs classes: strict, everything wrong at once, each with its place."""

from __future__ import annotations

import datetime as dt
import enum
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import attrs
import pytest

from beacon_gateway.problems import DocumentError, Problem
from beacon_gateway.structuring import Structurer

BARE_WORD = " (YAML reads a bare on, off, yes or no as true or false: put it in quotes)"


class Colour(enum.StrEnum):
    RED = "red"
    GREEN = "green"


@attrs.frozen
class Inner:
    needed: int
    _hidden: str = attrs.field(default="", init=False)


@attrs.frozen
class Everything:
    text: str = ""
    flag: bool = False
    count: int = 0
    number: float = 0.0
    path: Path = Path()
    colour: Colour = Colour.RED
    mode: Literal["router", "client", 3] = "router"
    items: tuple[int, ...] = ()
    listed: list[str] = attrs.Factory(list)
    bare: list = attrs.Factory(list)  # type: ignore[type-arg]
    table: Mapping[str, float] = attrs.Factory(dict)
    loose: dict = attrs.Factory(dict)  # type: ignore[type-arg]
    anything: Any = None
    inner: Inner | None = None
    either: Mapping[str, int] | tuple[str, ...] | str | None = None
    least: float = attrs.field(default=1.0, metadata={"at_least": 0.1})
    worded: int = attrs.field(default=1, metadata={"right": "a lucky number"})
    chosen: int = attrs.field(default=1, validator=attrs.validators.in_((1, 2)))
    even: int = attrs.field(default=0)

    @even.validator
    def _even(self, _: object, value: int) -> None:
        if (value + self.count) % 2:
            raise ValueError("count and even are odd together")


def problems(value: object, cls: type[Any] = Everything) -> list[str]:
    with pytest.raises(DocumentError) as caught:
        Structurer().structure(value, cls)
    assert str(caught.value) == "\n".join(map(str, caught.value.problems))
    return [str(problem) for problem in caught.value.problems]


def test_right_values_of_every_kind_are_taken() -> None:
    given = {
        "text": "a",
        "flag": True,
        "count": 2,
        "number": 3,
        "path": "some/where",
        "colour": "green",
        "mode": 3,
        "items": [1, 2],
        "listed": ["a"],
        "bare": [1, "b"],
        "table": {"a": 1},
        "loose": {"b": 2},
        "anything": {"x": [1]},
        "inner": {"needed": 1},
        "either": {"a": 1},
    }
    result = Structurer().structure(given, Everything)
    assert result == Everything(
        text="a",
        flag=True,
        count=2,
        number=3.0,
        path=Path("some/where"),
        colour=Colour.GREEN,
        mode=3,
        items=(1, 2),
        listed=["a"],
        bare=[1, "b"],
        table={"a": 1.0},
        loose={"b": 2},
        anything={"x": [1]},
        inner=Inner(1),
        either={"a": 1},
    )
    assert isinstance(result.number, float)
    assert type(result.colour) is Colour


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("text", 8080, "found the number 8080; give a text, in quotes"),
        ("text", None, "found nothing; give a text"),
        (
            "text",
            False,
            f"found false; give a text{BARE_WORD}",
        ),
        ("flag", "yes", "found the text 'yes'; give true or false"),
        ("flag", 1, "found the number 1; give true or false"),
        ("count", "8080", "found the text '8080'; give a whole number"),
        ("count", True, "found true; give a whole number"),
        ("count", 1.5, "found the number 1.5; give a whole number"),
        ("number", "ten", "found the text 'ten'; give a number"),
        ("number", False, "found false; give a number"),
        ("number", float("nan"), "found the number nan; give a finite number"),
        ("number", float("-inf"), "found the number -inf; give a finite number"),
        ("path", 5, "found the number 5; give a text, in quotes"),
        (
            "colour",
            "gren",
            "found the text 'gren'; give one of red, green; did you mean 'green'?",
        ),
        ("colour", ["red"], "found a list of 1; give one of red, green"),
        ("mode", True, "found true; give one of router, client, 3"),
        ("mode", "peer", "found the text 'peer'; give one of router, client, 3"),
        ("items", 1, "found the number 1; give a list"),
        ("items", "123", "found the text '123'; give a list"),
        ("table", [], "found a list of 0; give keys with values"),
        ("inner", "x", "found the text 'x'; give keys with values"),
        ("either", 1.5, "found the number 1.5; give keys with values or a list or a text"),
        ("worded", "x", "found the text 'x'; give a lucky number"),
        ("chosen", 3, "'chosen' must be in (1, 2) (got 3)"),
        ("even", 3, "count and even are odd together"),
    ],
)
def test_a_wrong_value_is_refused_with_what_was_found_and_what_is_right(
    key: str, value: object, message: str
) -> None:
    (problem,) = problems({key: value})
    assert problem.startswith(f"$.{key}: {message}")


def test_a_whole_number_beyond_every_float_is_refused() -> None:
    (problem,) = problems({"number": 10**400})
    assert problem.startswith("$.number: found the number 1000")
    assert problem.endswith("…; give a finite number")


def test_the_document_itself_may_be_of_the_wrong_kind() -> None:
    assert problems("hello") == ["$: found the text 'hello'; give keys with values"]


def test_an_empty_section_means_its_defaults() -> None:
    assert Structurer().structure(None, Everything) == Everything()


def test_a_missing_key_says_what_to_give() -> None:
    assert problems({"inner": {}}) == ["$.inner.needed: missing; give a whole number"]


def test_unknown_keys_suggest_the_near_one_or_show_all() -> None:
    assert problems({"colur": 1}) == ["$.colur: unknown key; did you mean 'colour'?"]
    assert problems({"zzz": 1}, Inner) == [
        "$.zzz: unknown key; possible here: needed",
        "$.needed: missing; give a whole number",
    ]


def test_a_bare_yes_as_a_key_is_explained() -> None:
    (problem,) = problems({True: 1})
    assert problem.startswith("$[True]: unknown key")
    assert "put it in quotes" in problem


def test_keys_of_a_table_must_be_texts() -> None:
    assert problems({"table": {5: 1.0, True: 2.0}}) == [
        "$.table[5]: this key is not a text; put it in quotes",
        f"$.table[True]: this key is not a text{BARE_WORD}",
    ]


def test_every_problem_is_reported_with_its_path_in_one_go() -> None:
    given = {
        "nope": 1,
        "items": [1, "x", None],
        "table": {"a": "b", "a key": None},
        "inner": {"needed": "x", "more": 1},
        "either": ["a", 5],
        "chosen": 7,
        "count": "x",
        "even": 3,
    }
    assert [problem.split(":")[0] for problem in problems(given)] == [
        "$.nope",
        "$.count",
        "$.items[1]",
        "$.items[2]",
        "$.table.a",
        "$.table['a key']",
        "$.inner.more",
        "$.inner.needed",
        "$.either[1]",
        # `even` is judged together with `count`, which is wrong itself: nothing to say of it yet.
        "$.chosen",
    ]


def test_too_small_a_number_is_lifted_and_reported() -> None:
    structurer = Structurer()
    assert structurer.structure({"least": 0}, Everything).least == 0.1
    assert structurer.corrections == [Problem("$.least", "0.0 is too small; using 0.1")]


def test_what_a_class_says_of_itself_as_a_whole_is_a_problem_of_the_whole() -> None:
    @attrs.frozen
    class Odd:
        a: int = 0

        def __attrs_post_init__(self) -> None:
            raise ValueError

    assert problems({"a": 1}, Odd) == ["$: "]


def test_an_optional_number_says_a_number_is_right() -> None:
    @attrs.frozen
    class Maybe:
        a: int | None = None

    assert Structurer().structure({"a": None}, Maybe) == Maybe()
    assert problems({"a": "x"}, Maybe) == ["$.a: found the text 'x'; give a whole number"]


def test_a_date_is_shown_as_what_it_is() -> None:
    (problem,) = problems({"text": dt.date(2026, 1, 2)})
    assert problem == "$.text: found the date 2026-01-02; give a text, in quotes"


def test_long_and_hostile_values_are_shown_short_and_on_one_line() -> None:
    (problem,) = problems({"count": "\x1b[31m\n" * 1000})
    assert problem.isprintable()
    assert len(problem) < 120
    (problem,) = problems({"count": {}})
    assert problem == "$.count: found an empty mapping; give a whole number"
