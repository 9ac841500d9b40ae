"""How the benches measure: side by side, the best of many short rounds, ratios only.

Each subject does its work once per round, and the rounds of all subjects take turns, so that
whatever else the machine does meets them alike. The best round is the one that was disturbed least.
The garbage collector is off while measuring, as in ``timeit``.
"""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Callable, Mapping

__all__ = ["Report", "best_ns", "options"]


def best_ns(subjects: Mapping[str, Callable[[], object]], *, rounds: int) -> dict[str, float]:
    """The shortest processor time of each subject over ``rounds``, in nanoseconds."""
    best = dict.fromkeys(subjects, float("inf"))
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, subject in subjects.items():
                start = time.perf_counter_ns()
                subject()
                best[name] = min(best[name], time.perf_counter_ns() - start)
    finally:
        gc.enable()
    return best


class Report:
    """Ratios and what they should be, printed as a table; knows whether all were met."""

    def __init__(self, title: str) -> None:
        self.met = True
        print(f"\n{title}\n")
        print(f"{'':58} {'ratio':>8}  {'at most':>8}")

    def ratio(self, what: str, value: float, at_most: float | None = None) -> None:
        """One line; without ``at_most`` it is for information only."""
        if at_most is None:
            print(f"{what:58} {value:8.3f}")
            return
        met = value <= at_most
        self.met &= met
        print(f"{what:58} {value:8.3f}  {at_most:8g}  {'ok' if met else 'NOT MET'}")

    def line(self, text: str) -> None:
        print(text)

    def finish(self, *, check: bool) -> None:
        """Leave with status 1 if something was not met and the caller wants to know."""
        if check and not self.met:
            sys.exit(1)


def options() -> argparse.Namespace:
    """``--quick``: a few rounds, to see that it runs. ``--check``: status 1 if not all is met."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="a few rounds, to see that it runs")
    parser.add_argument("--check", action="store_true", help="exit 1 if a ratio is not met")
    parser.add_argument("--profile", action="store_true", help="say where the time goes")
    return parser.parse_args()
