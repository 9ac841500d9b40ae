"""A context that is about to end is told of nobody any more, so that its end waits for nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no context to end")

from rclpy.context import Context
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

from beacon_ros import ending
from beacon_ros.ending import deafen

Eventually = Callable[..., None]


@contextmanager
def alone(name: str, domain: int) -> Iterator[Node]:
    """A node in a context of its own."""
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=domain)
    node = Node(name, context=context, use_global_arguments=False)
    try:
        yield node
    finally:
        deafen(node)
        node.destroy_node()
        context.try_shutdown()
        context.destroy()


def test_after_it_who_comes_is_told_to_others_only(domain: int, eventually: Eventually) -> None:
    with alone("deaf", domain) as deaf, alone("witness", domain) as witness:
        deaf.create_publisher(UUID, "/early", 1)
        eventually(lambda: witness.count_publishers("/early") == 1)
        assert deafen(deaf)
        with alone("late", domain) as late:
            late.create_publisher(UUID, "/late", 1)
            eventually(lambda: witness.count_publishers("/late") == 1)
            assert deaf.count_publishers("/late") == 0


def test_it_may_be_done_again(domain: int) -> None:
    with alone("deaf", domain) as deaf:
        assert deafen(deaf)
        assert deafen(deaf)


def test_a_node_that_is_gone_already_is_no_error(domain: int) -> None:
    with alone("first", domain) as first:
        first.destroy_node()
        assert not deafen(first)


@pytest.mark.parametrize("rmw", ["rmw_cyclonedds_cpp", "rmw_fastrtps_dynamic_cpp"])
def test_with_another_middleware_nothing_is_touched(
    domain: int, monkeypatch: pytest.MonkeyPatch, rmw: str
) -> None:
    with alone("node", domain) as node, monkeypatch.context() as patch:
        patch.setattr(ending, "get_rmw_implementation_identifier", lambda: rmw)
        assert not deafen(node)


def test_with_a_version_that_has_no_such_function_nothing_is_touched(
    domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with alone("node", domain) as node, monkeypatch.context() as patch:
        patch.setattr(ending, "_SET_LISTENER", "_ZN8eprosima7nothing")
        assert not deafen(node)
