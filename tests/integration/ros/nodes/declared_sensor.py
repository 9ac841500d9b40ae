# mypy: ignore-errors
"""A sensor that says what it is by its parameters: most come from a file, some it knows itself."""

from __future__ import annotations

import os
import socket

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


class DeclaredSensor(Node):
    def __init__(self) -> None:
        super().__init__("temp_sensor", automatically_declare_parameters_from_overrides=True)
        self.declare_parameter("ros2_medkit.discovery.process_id", os.getpid())
        self.declare_parameter("ros2_medkit.discovery.hostname", socket.gethostname())


def main() -> None:
    rclpy.init()
    node = DeclaredSensor()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
