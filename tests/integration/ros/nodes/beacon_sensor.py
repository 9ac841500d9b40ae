# mypy: ignore-errors
"""A sensor with a beacon that follows what it does; ended as tidily as its argument says."""

from __future__ import annotations

import sys

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from beacon_core.hint import BeaconHint
from beacon_ros_topic.beacon import TopicBeacon


class BeaconSensor(Node):
    def __init__(self) -> None:
        super().__init__("temp_sensor")
        self.declare_parameter("mode", "measuring")
        hint = BeaconHint("temp_sensor", metadata={"mode": "measuring"})
        self._beacon = TopicBeacon(self, hint, period_s=1.0)
        self.add_on_set_parameters_callback(self.on_set)

    def on_set(self, parameters: list[rclpy.Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "mode":
                self._beacon.update(metadata={"mode": parameter.value})
        return SetParametersResult(successful=True)


def tidy() -> None:
    rclpy.init()
    node = BeaconSensor()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def careless() -> None:
    rclpy.init()
    rclpy.spin(BeaconSensor())


if __name__ == "__main__":
    careless() if "careless" in sys.argv else tidy()
