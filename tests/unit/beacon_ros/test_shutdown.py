"""Who wants to know of a context's end is told, once, and only for as long as it wants to."""

from __future__ import annotations

import gc
import subprocess
import threading
from collections.abc import Callable

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no contexts")

from rclpy.context import Context

from beacon_ros.shutdown import at_shutdown


def context_in(domain: int) -> Context:
    made = Context()
    made.init(args=[], initialize_logging=False, domain_id=domain)
    return made


def test_all_are_told_once_and_of_their_own_context_only(domain: int) -> None:
    first, second = context_in(domain), context_in(domain)
    told: list[str] = []
    at_shutdown(first, lambda: told.append("first"))
    at_shutdown(first, lambda: told.append("first too"))
    at_shutdown(second, lambda: told.append("second"))
    first.shutdown()
    assert told == ["first", "first too"]
    second.try_shutdown()
    second.try_shutdown()
    assert told == ["first", "first too", "second"]


def test_who_does_not_want_to_know_any_more_is_not_told_and_not_kept(domain: int) -> None:
    class Somebody:
        def hear(self) -> None:
            told.append(self)

    told: list[Somebody] = []
    context, somebody = context_in(domain), Somebody()
    stop = at_shutdown(context, somebody.hear)
    stop()
    stop()
    held = len(gc.get_referrers(somebody))
    context.shutdown()
    assert told == []
    assert held <= 1


def test_none_is_left_out_when_those_who_were_told_go_at_once(domain: int) -> None:
    told: list[int] = []

    class Somebody:
        def __init__(self, number: int) -> None:
            self.number = number
            self.stop = at_shutdown(context, self.hear)

        def hear(self) -> None:
            told.append(self.number)
            self.stop()

    context = context_in(domain)
    for number in range(6):
        Somebody(number)
    gc.collect()
    context.shutdown()
    assert told == list(range(6))


def test_a_context_that_has_ended_is_told_of_at_once(domain: int) -> None:
    context, told = context_in(domain), threading.Event()
    context.shutdown()
    at_shutdown(context, told.set)
    assert told.is_set()


def test_a_program_that_ends_without_shutting_down_says_nothing(
    run_script: Callable[[str], subprocess.CompletedProcess[str]],
) -> None:
    ended = run_script(
        "from rclpy.context import Context\n"
        "from beacon_ros.shutdown import at_shutdown\n"
        "context = Context()\n"
        "context.init(args=[], initialize_logging=False)\n"
        "class Somebody:\n"
        "    def hear(self): pass\n"
        "kept = Somebody()\n"
        "stop = at_shutdown(context, kept.hear)\n"
    )
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
