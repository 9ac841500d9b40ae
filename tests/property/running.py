"""How the machines are run: so many short runs, always the same ones for a seed, which is printed.

BEACON_MACHINE_SEED=7       another run than usual
BEACON_MACHINE_SHRINK=0     a failing run is not made small, which takes minutes
"""

from __future__ import annotations

import os

import hypothesis
from hypothesis import HealthCheck, Phase, settings
from hypothesis.stateful import RuleBasedStateMachine, run_state_machine_as_test

__all__ = ["first_seed", "run"]


def first_seed() -> int:
    """The one that was asked for, or the usual one."""
    return int(os.environ.get("BEACON_MACHINE_SEED", "1"))


def run(
    machine: type[RuleBasedStateMachine],
    *,
    runs: int,
    steps_per_run: int,
    seed: int | None = None,
) -> None:
    """Raises what the first run raises that fails."""
    chosen = first_seed() if seed is None else seed
    print(f"{machine.__name__}: seed {chosen}")  # noqa: T201 - shown when it fails
    shrink = [] if os.environ.get("BEACON_MACHINE_SHRINK") == "0" else [Phase.shrink]
    rules = settings(
        phases=[Phase.generate, *shrink],
        max_examples=runs,
        stateful_step_count=steps_per_run,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
        report_multiple_bugs=False,
    )
    # A seed is kept by the class, so it is given to one that is made for this.
    seeded = hypothesis.seed(chosen)(type("Seeded", (machine,), {}))
    run_state_machine_as_test(seeded, settings=rules)
