"""Examining carriers side by side: whatever an adapter does, there is an answer in time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import attrs
import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.examination import Finding, Level
from beacon_fake import ADAPTER as FAKE
from beacon_gateway.config import parse_config
from beacon_gateway.console.checkup import Checkup, check_up

Examine = Callable[[Any, float], Iterable[Finding]]

WELL = Finding(Level.OK, "all is well")


@attrs.frozen
class Options:
    word: str = ""


class Source:
    """Cannot be made if told so."""

    closed: list[Source]

    def __init__(self, options: Options) -> None:
        if options.word == "refused":
            raise ConfigError("it needs something that is not installed")

    def close(self) -> None:
        Source.closed.append(self)


@pytest.fixture(autouse=True)
def _fresh() -> None:
    Source.closed = []


def looked(
    *examinations: Examine | None, word: str = "", patience_s: float = 10.0
) -> Iterator[Checkup]:
    """Each examination with a source of its own: s0, s1, ..."""
    adapters = {f"a{number}": one for number, one in enumerate(examinations)}

    def lookup(name: str) -> Adapter:
        made: Any = Source
        return attrs.evolve(FAKE, name=name, options=Options, source=made, examine=adapters[name])

    sources = {
        f"s{number}": {"adapter": name, "options": {"word": word}}
        for number, name in enumerate(adapters)
    }
    config = parse_config({"sources": sources}, lookup).config
    return check_up(config, 0.1, lookup=lookup, patience_s=patience_s)


def test_what_is_found_is_told_in_the_order_of_the_configuration() -> None:
    first_may_end = threading.Event()

    def slow(options: Options, seconds: float) -> Iterator[Finding]:
        yield Finding(Level.NOTE, f"looking {seconds} s for {options.word}")
        first_may_end.wait(10)
        yield Finding(Level.PROBLEM, "nobody is there", "switch it on")

    def quick(_: Options, __: float) -> list[Finding]:
        first_may_end.set()
        return [WELL]

    # Side by side: the first ends only because the second has been reached.
    first, second = looked(slow, quick, word="robots")
    assert first == Checkup(
        "s0",
        "a0",
        (
            Finding(Level.NOTE, "looking 0.1 s for robots"),
            Finding(Level.PROBLEM, "nobody is there", "switch it on"),
        ),
    )
    assert second == Checkup("s1", "a1", (WELL,))


def test_each_is_told_as_soon_as_it_is_through() -> None:
    second_may_end = threading.Event()

    def slow(_: Options, __: float) -> Iterator[Finding]:
        second_may_end.wait(10)
        yield WELL

    told = looked(lambda *_: [WELL], slow)
    assert next(told).name == "s0"
    second_may_end.set()
    assert next(told).findings == (WELL,)


def test_an_adapter_that_hangs_keeps_nobody_waiting_and_what_it_found_is_kept() -> None:
    released = threading.Event()

    def hang(_: Options, __: float) -> Iterator[Finding]:
        yield WELL
        released.wait(30)

    began = time.monotonic()
    hung, other = looked(hang, lambda *_: [WELL], patience_s=0.2)
    assert time.monotonic() - began < 10
    released.set()
    assert hung.findings[0] == WELL
    assert hung.findings[1].level is Level.PROBLEM
    assert hung.findings[1].what == "the examination was not through after 0 s"
    assert other.findings == (WELL,)


def test_an_adapter_without_an_examination_is_no_problem() -> None:
    (told,) = looked(None)
    (finding,) = told.findings
    assert finding.level is Level.NOTE
    assert finding.what == "the adapter 'a0' offers no examination"


def test_a_source_that_cannot_be_made_is_the_first_thing_to_know() -> None:
    (told,) = looked(lambda *_: [WELL], word="refused")
    assert told.findings == (Finding(Level.PROBLEM, "it needs something that is not installed"),)


def test_no_source_is_left_open() -> None:
    list(looked(lambda *_: [WELL], None))
    assert len(Source.closed) == 2


def broken(_: Options, __: float) -> Iterator[Finding]:
    yield WELL
    raise LookupError("what went wrong")


def test_a_defect_of_an_adapter_is_told_as_one() -> None:
    (told,) = looked(broken)
    assert told.findings == (
        WELL,
        Finding(
            Level.PROBLEM,
            "the examination failed: LookupError: what went wrong",
            "a defect of the adapter 'a0': please report it",
        ),
    )


@pytest.mark.parametrize("findings", [["all is well"], None])
def test_what_is_no_finding_is_a_defect(findings: Any) -> None:
    (told,) = looked(lambda *_: findings)
    (finding,) = told.findings
    assert finding.what.startswith("the examination failed: TypeError: ")
