"""The core's own tests are not traced while others are: ``tools/cover_alone.py`` does that, module
by module, and traced a machine takes twice its time."""

from __future__ import annotations

from pathlib import Path

import pytest

HERE = Path(__file__).parent
UNTRACED = (HERE / "property", HERE / "unit" / "core")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if any(item.path.is_relative_to(folder) for folder in UNTRACED):
            item.add_marker(pytest.mark.no_cover)
