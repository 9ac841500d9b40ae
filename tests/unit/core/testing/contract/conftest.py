"""Runs single checks of the suite against a harness of the test's choosing, outside pytest."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from beacon_core.testing.contract import AdapterContract
from beacon_core.testing.harness import Harness

Run = Callable[..., None]


@pytest.fixture
def run() -> Run:
    """``run(check, harness, **parameters)`` raises what the check raises, and closes the harness.

    What a broken adapter raises when it is closed is not the check's business, and is dropped.
    """

    def run(check: str, harness: Harness, **parameters: Any) -> None:
        suite = AdapterContract()
        values = "-".join(str(value) for value in parameters.values())
        suite.check = f"{check}[{values}]" if parameters else check
        try:
            getattr(suite, check)(harness, **parameters)
        finally:
            with suppress(Exception):
                harness.close()

    return run
