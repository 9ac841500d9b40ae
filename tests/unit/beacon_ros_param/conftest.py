"""ROS nodes with parameters, each test's in a domain of its own; those of one test in one process.

They have a context of their own: what they are tested with finds them over DDS.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from beacon_ros.domains import DomainLease

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node

    from beacon_ros.spinner import Spinner

DEADLINE_S = 20.0
AGAIN_S = 2.0

Ask = Callable[[Callable[[Any], None]], object]
"""Asks a question, whose answer is to be given to this."""


@pytest.fixture
def wait_for() -> Callable[..., None]:
    """Fails if it does not become true within a deadline, which only failing tests wait for."""

    def wait_for(true: Callable[[], object], what: str = "it is true") -> None:
        deadline = time.monotonic() + DEADLINE_S
        while not true():
            assert time.monotonic() < deadline, f"not within {DEADLINE_S} s: {what}"
            time.sleep(0.005)

    return wait_for


@pytest.fixture
def answer_to(wait_for: Callable[..., None]) -> Callable[[Ask], Any]:
    """Asks, and gives the answer."""

    def answer_to(ask: Ask) -> Any:
        answers: list[Any] = []
        due_s = [time.monotonic()]

        def answered() -> bool:
            # Again: who has not found the asker yet drops its answer.
            if time.monotonic() >= due_s[0]:
                due_s[0] += AGAIN_S
                ask(answers.append)
            return bool(answers)

        wait_for(answered, "an answer comes")
        return answers[0]

    return answer_to


@pytest.fixture
def domain_id() -> Iterator[int]:
    with DomainLease() as lease:
        yield lease.domain_id


class Peers:
    """Other people's nodes. ``spinner`` serves them; ``new`` makes one, with parameters."""

    def __init__(self, domain_id: int) -> None:
        from rclpy.context import Context  # noqa: PLC0415 - without rclpy other tests still run

        from beacon_ros.spinner import Spinner  # noqa: PLC0415

        self.context: Context = Context()
        self.context.init(args=[], initialize_logging=False, domain_id=domain_id)
        self.spinner: Spinner = Spinner(self.context)
        self.nodes: list[Node] = []

    def new(self, name: str, **parameters: Any) -> Node:
        from rclpy.node import Node  # noqa: PLC0415

        node = Node(name, context=self.context, use_global_arguments=False, enable_rosout=False)
        for key, value in parameters.items():
            node.declare_parameter(f"ros2_medkit.discovery.{key}", value)
        self.nodes.append(node)
        self.spinner.add_node(node)
        return node

    def remove(self, node: Node) -> None:
        self.nodes.remove(node)
        self.spinner.remove_node(node)
        node.destroy_node()

    def close(self) -> None:
        assert self.spinner.close(DEADLINE_S)
        for node in self.nodes:
            node.destroy_node()
        self.context.try_shutdown()
        self.context.destroy()


@pytest.fixture
def peers(domain_id: int) -> Iterator[Peers]:
    made = Peers(domain_id)
    yield made
    made.close()
