# mypy: ignore-errors
"""What ``ros2 param set NODE NAME VALUE`` does."""

from __future__ import annotations

import sys

import rclpy
from rcl_interfaces.msg import Parameter
from rclpy.parameter import get_parameter_value
from rclpy.parameter_client import AsyncParameterClient


def main(node_name: str, name: str, value: str) -> str:
    """Returns why it was not done; ``""`` if it was."""
    rclpy.init()
    node = rclpy.create_node("_param_set")
    client = AsyncParameterClient(node, node_name)
    if not client.wait_for_services(20.0):
        return f"{node_name} has no parameter services"
    parameter = Parameter(name=name, value=get_parameter_value(value))
    for _ in range(10):
        # Again: who has not found us yet drops its answer.
        answer = client.set_parameters([parameter])
        rclpy.spin_until_future_complete(node, answer, timeout_sec=2.0)
        if answer.done():
            break
    result = answer.result().results[0]
    node.destroy_node()
    rclpy.shutdown()
    return "" if result.successful else result.reason or "refused"


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]) or 0)
