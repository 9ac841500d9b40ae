"""``--record-canonical`` writes the suite's canonical results anew, from the run at hand."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path

import pytest

from beacon_core.testing.contract.base import ContractBase


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record-canonical", action="store_true", help="see tests/contract/conftest")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--record-canonical"):
        ContractBase.recorded = {}


def pytest_sessionfinish() -> None:
    if ContractBase.recorded:
        text = json.dumps(ContractBase.recorded, indent=1, sort_keys=True, ensure_ascii=True)
        kept = resources.files("beacon_core.testing.contract") / "canonical.json"
        Path(str(kept)).write_text(text + "\n", "utf-8")
