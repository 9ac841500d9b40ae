"""How the ``beacon`` command logs."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator

import pytest

from beacon_gateway.config import LogFormat, LogLevel
from beacon_gateway.console.logs import set_up_logging

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _restored() -> Iterator[None]:
    root = logging.getLogger()
    level, handlers = root.level, root.handlers[:]
    yield
    root.setLevel(level)
    root.handlers[:] = handlers


def test_a_line_of_json_says_when_how_grave_who_and_what(capsys: Capture) -> None:
    set_up_logging(LogLevel.INFO, LogFormat.JSON)
    logging.getLogger("a.b").warning("two %s\nlines", "hard")
    (line,) = capsys.readouterr().err.splitlines()
    said = json.loads(line)
    assert said.pop("time").endswith("Z")
    assert said == {"level": "warning", "logger": "a.b", "message": "two hard\nlines"}


def test_an_exception_is_in_the_same_line(capsys: Capture) -> None:
    set_up_logging(LogLevel.INFO, LogFormat.JSON)
    try:
        int("no number")
    except ValueError:
        logging.getLogger("a").exception("failed")
    (line,) = capsys.readouterr().err.splitlines()
    assert "ValueError: invalid literal" in json.loads(line)["exception"]


@pytest.mark.parametrize("form", LogFormat)
def test_what_is_less_grave_than_the_level_is_not_said(capsys: Capture, form: LogFormat) -> None:
    set_up_logging(LogLevel.ERROR, form)
    logging.getLogger("a").warning("hm")
    assert capsys.readouterr().err == ""


def test_text_is_for_people(capsys: Capture) -> None:
    set_up_logging(LogLevel.DEBUG)
    logging.getLogger("a").debug("hello")
    assert capsys.readouterr().err.endswith(" DEBUG   a: hello\n")


def test_what_strangers_send_fills_no_log(capsys: Capture) -> None:
    set_up_logging(LogLevel.DEBUG)
    logging.getLogger("uvicorn.error").warning("Invalid HTTP request received.")
    assert capsys.readouterr().err == ""
