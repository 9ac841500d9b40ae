"""The suite is whole: every check is in it once, and each result that is kept is one of a check."""

from __future__ import annotations

import inspect
import json
from importlib import resources

from beacon_core.testing.contract import AdapterContract


def checks() -> list[str]:
    """The names of all checks."""
    return [name for name, _ in inspect.getmembers(AdapterContract) if name.startswith("test_")]


def test_no_check_hides_another_of_the_same_name() -> None:
    declared = [name for theme in AdapterContract.__bases__ for name in vars(theme)]
    declared = [name for name in declared if name.startswith("test_")]
    assert sorted(declared) == sorted(checks())
    assert len(declared) >= 30


def test_every_kept_result_belongs_to_a_check() -> None:
    text = resources.files("beacon_core.testing.contract").joinpath("canonical.json").read_text()
    assert {name.partition("[")[0] for name in json.loads(text)} <= set(checks())
