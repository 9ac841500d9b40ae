"""What is asserted in the machine's parts is shown as fully as in a test."""

from __future__ import annotations

import pytest

pytest.register_assert_rewrite("tests.property.side_by_side")
