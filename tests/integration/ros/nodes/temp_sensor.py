# mypy: ignore-errors
"""A sensor as anybody would write it with rclpy, which says twice a second what it is.

``-p reliability:=best_effort`` for what most sensors use; ``-p use_sim_time:=true`` for stamps, and
a timer, of simulated time.
"""

from __future__ import annotations

import os
import socket

import rclpy
from diagnostic_msgs.msg import KeyValue
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros2_medkit_msgs.msg import MedkitDiscoveryHint


class TempSensor(Node):
    def __init__(self) -> None:
        super().__init__("temp_sensor")
        reliability = self.declare_parameter("reliability", "reliable").value
        qos = QoSProfile(depth=10, reliability=ReliabilityPolicy[str(reliability).upper()])
        self._beacon = self.create_publisher(MedkitDiscoveryHint, "/ros2_medkit/discovery", qos)
        self._timer = self.create_timer(0.5, self.say)

    def say(self) -> None:
        hint = MedkitDiscoveryHint()
        hint.entity_id = "temp_sensor"
        hint.stable_id = "sn-0815"
        hint.display_name = "Temperature, engine (°C)"
        hint.function_ids = ["monitoring", "thermal"]
        hint.depends_on = ["can_bridge"]
        hint.component_id = "ecu_front"
        hint.transport_type = "shared_memory"
        hint.negotiated_format = "sensor_msgs/Temperature"
        hint.process_id = os.getpid()
        hint.process_name = "temp_sensor_node"
        hint.hostname = socket.gethostname()
        hint.metadata = [
            KeyValue(key="firmware", value="1.2.3"),
            KeyValue(key="vendor", value="acme"),
        ]
        hint.stamp = self.get_clock().now().to_msg()
        self._beacon.publish(hint)


def main() -> None:
    rclpy.init()
    node = TempSensor()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
