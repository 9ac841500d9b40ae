"""A relay's nodes say by their names who took the messages first, and how far they came."""

from __future__ import annotations

import pytest

from beacon_core.relay.marks import CONDUIT_ROLE, Mark, is_conduit, mark_of, role


@pytest.mark.parametrize("mark", [(1, 1), (0x1234_5678_9ABC_DEF0, 2), (2**64 - 1, 255)])
def test_what_is_written_is_read(mark: Mark) -> None:
    assert mark_of(f"/_beacon_{role(mark)}_4711_3") == mark


@pytest.mark.parametrize(
    "node",
    [
        "/talker",
        "/_beacon_relay_4711_3",
        "/_beacon_relay_123_h1_4711_3",
        "/_beacon_relay_123456789abcdef0_4711",
        "/fleet/_beacon_relay_123456789abcdefg_h1_1_1",
        "",
    ],
)
def test_other_nodes_have_no_mark(node: str) -> None:
    assert mark_of(node) == (0, 0)


def test_a_conduit_is_told_from_a_relay_and_from_others() -> None:
    assert is_conduit(f"/_beacon_{CONDUIT_ROLE}_4711_3")
    assert not is_conduit(f"/_beacon_{role((1, 1))}_4711_3")
    assert not is_conduit("/relay_conduit")
    assert mark_of(f"/_beacon_{CONDUIT_ROLE}_4711_3") == (0, 0)
