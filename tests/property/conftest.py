"""For all machines: what is asserted in their parts is shown in full, and nothing slows them."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

pytest.register_assert_rewrite("tests.property.side_by_side")


@pytest.fixture(autouse=True)
def _untraced() -> Iterator[None]:
    """Who measures coverage looks elsewhere: it takes two thirds of a machine's time (measured),
    and what a machine covers by chance tells nobody whether a module is tested."""
    tracer = sys.gettrace()
    sys.settrace(None)
    yield
    sys.settrace(tracer)
