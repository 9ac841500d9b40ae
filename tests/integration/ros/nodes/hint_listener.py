# mypy: ignore-errors
# ruff: noqa: T201
"""Listens for hints as any rclpy program would, and prints each as a line of JSON."""

from __future__ import annotations

import json

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from ros2_medkit_msgs.msg import MedkitDiscoveryHint


class HintListener(Node):
    def __init__(self) -> None:
        super().__init__("hint_listener")
        self._subscription = self.create_subscription(
            MedkitDiscoveryHint, "/ros2_medkit/discovery", self.on_hint, 10
        )
        print(json.dumps({"listening": True}))

    def on_hint(self, hint: MedkitDiscoveryHint) -> None:
        plain = {
            name: getattr(hint, name)
            for name in hint.get_fields_and_field_types()
            if name not in {"metadata", "stamp"}
        }
        plain["metadata"] = {entry.key: entry.value for entry in hint.metadata}
        plain["stamp"] = [hint.stamp.sec, hint.stamp.nanosec]
        print(json.dumps(plain))


def main() -> None:
    rclpy.init()
    node = HintListener()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
