"""Check that each module of beacon_core is covered wholly by its own unit tests alone.

A module that is covered only because some other test happens to pass through it has no tests of
its own: nobody would notice if that other test changed. So ``beacon_core/a/b.py`` is measured,
branches included, while nothing but ``tests/unit/core/a/test_b.py`` runs.

    python tools/cover_alone.py                       every module
    python tools/cover_alone.py beacon_core/hint.py   some

Exits with 1 unless every module has 100 % and every test passes.
"""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import attrs
import coverage
import hypothesis
import pytest

__all__ = ["Result", "main"]

ROOT = Path(__file__).parents[1]
CORE = ROOT / "beacon_core"
TESTS = ROOT / "tests" / "unit" / "core"

# Large, and used by many tests: imported once here, not in every process and under measurement.
PRELOADED = [hypothesis]
PLUGINS = ["-p", "pytest_timeout"]

# The suites are made of tests themselves; tests/contract runs them against every carrier.
RELAY = CORE / "testing" / "relay"
SUITES = [
    CORE / "testing" / "contract",
    RELAY / "conduits.py",
    RELAY / "topic_sides.py",
    RELAY / "topic_steps.py",
]


@attrs.frozen
class Result:
    """What came of one module."""

    module: str
    complaint: str
    """Empty if all is well; otherwise what is missing."""
    covered: float = 0.0
    """In percent, lines and branches together."""
    statements: int = 0
    branches: int = 0
    seconds: float = 0.0
    output: str = ""
    """What pytest wrote, if the tests failed."""


def main(chosen: list[str]) -> int:
    """Measure the chosen modules, or all; print a table; return the exit code."""
    modules = [Path(name).resolve() for name in chosen] or every_module()
    # Forked, so that each begins with pytest imported and beacon_core not yet.
    with multiprocessing.get_context("fork").Pool(2, maxtasksperchild=1) as pool:
        results = []
        for result in pool.imap(measure, modules, chunksize=1):
            print(line(result), flush=True)
            results.append(result)
    failed = [result for result in results if result.complaint]
    for result in failed:
        if result.output:
            print(f"\n--- {result.module}\n{result.output}")
    print(
        f"\n{len(results) - len(failed)} of {len(results)} modules are covered by their own tests"
    )
    return 1 if failed else 0


def every_module() -> list[Path]:
    return [
        path
        for path in sorted(CORE.rglob("*.py"))
        # An __init__ only exports what others define.
        if path.name != "__init__.py" and not any(path.is_relative_to(suite) for suite in SUITES)
    ]


def measure(module: Path) -> Result:
    """Run one module's tests in this process, which must not have imported it before."""
    name = str(module.relative_to(ROOT))
    inside = module.relative_to(CORE)
    test = TESTS / inside.parent / f"test_{inside.name}"
    if not test.exists():
        return Result(name, f"no {test.relative_to(ROOT)}")
    started = time.monotonic()
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    watch = coverage.Coverage(
        data_file=None, config_file=str(ROOT / "pyproject.toml"), include=[str(module)]
    )
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output), watch.collect():
        code = pytest.main(["-q", "-x", "-p", "no:cacheprovider", *PLUGINS, str(test)])
    took = time.monotonic() - started
    if code != pytest.ExitCode.OK:
        return Result(name, "its tests fail", seconds=took, output=output.getvalue())
    return judge(name, watch, took)


def judge(name: str, watch: coverage.Coverage, took: float) -> Result:
    with tempfile.NamedTemporaryFile(suffix=".json") as report:
        try:
            watch.json_report(outfile=report.name)
        except coverage.exceptions.NoDataError:
            return Result(name, "its tests never import it", seconds=took)
        (found,) = json.load(report)["files"].values()
    summary = found["summary"]
    return Result(
        name,
        complaint(found),
        covered=summary["percent_covered"],
        statements=summary["num_statements"],
        branches=summary["num_branches"],
        seconds=took,
    )


def complaint(found: dict[str, Any]) -> str:
    lines = [str(one) for one in found["missing_lines"]]
    # A branch is a pair of lines; a negative one is the way out of a function.
    jumps = [f"{a}->{b}" for a, b in found["missing_branches"]]
    return ", ".join([*(f"line {one}" for one in lines), *(f"branch {one}" for one in jumps)])


def line(result: Result) -> str:
    mark = "FAIL" if result.complaint else "ok"
    return (
        f"{mark:4} {result.module:45} {result.covered:6.1f} % {result.statements:5} statements"
        f" {result.branches:4} branches {result.seconds:5.1f} s  {result.complaint}"
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
