"""Quoting: foreign text in a log line is one line, ASCII, short, and cannot pose as anything."""

from __future__ import annotations

import ast

import pytest

from beacon_core.limits import MAX_LOG_CHARS
from beacon_core.text import quoted


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "''"),
        ("engine_temp", "'engine_temp'"),
        ("a b", "'a b'"),
        ("it's", '"it\'s"'),
        ("line\nbreak\r\t", r"'line\nbreak\r\t'"),
        ("\x1b[31mred", r"'\x1b[31mred'"),
        ("back\\slash", r"'back\\slash'"),
        ("\x00\x7f\x85", r"'\x00\x7f\x85'"),
    ],
)
def test_short_text_is_quoted_and_its_controls_are_escaped(text: str, expected: str) -> None:
    assert quoted(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("straße", r"'stra\xdfe'"),
        ("n\u0661", r"'n\u0661'"),  # Arabic-Indic one
        ("a\u202eb", r"'a\u202eb'"),  # right-to-left override
        ("\u2028", r"'\u2028'"),
        ("\N{GRINNING FACE}", r"'\U0001f600'"),
        ("\udc80", r"'\udc80'"),
    ],
)
def test_whatever_could_deceive_the_eye_is_seen_for_what_it_is(text: str, expected: str) -> None:
    assert quoted(text) == expected


def test_text_that_just_fits_is_whole() -> None:
    text = "x" * (MAX_LOG_CHARS - 2)
    assert quoted(text) == f"'{text}'"


@pytest.mark.parametrize("length", [MAX_LOG_CHARS - 1, MAX_LOG_CHARS, MAX_LOG_CHARS + 1, 10**6])
def test_longer_text_is_cut_and_the_cut_is_shown(length: int) -> None:
    assert quoted("x" * length) == "'" + "x" * (MAX_LOG_CHARS - 5) + "'..."


@pytest.mark.parametrize("char", ["\n", "\\", "\x00", "é", "日", "\N{GRINNING FACE}", "\ud800"])
@pytest.mark.parametrize("lead", range(12))
def test_the_cut_never_goes_through_an_escape(char: str, lead: int) -> None:
    text = "x" * lead + char * 200
    shown = quoted(text)
    assert shown.endswith("'...")
    assert len(shown) <= MAX_LOG_CHARS
    assert text.startswith(ast.literal_eval(shown.removesuffix("...")))


def test_a_cut_between_escaped_backslashes_and_letters_is_no_escape_either() -> None:
    text = "\\x\\u\\U" * 100
    shown = quoted(text)
    assert text.startswith(ast.literal_eval(shown.removesuffix("...")))


def test_a_megabyte_costs_no_more_than_a_line() -> None:
    assert len(quoted("'\n" * 2**19)) <= MAX_LOG_CHARS
