# mypy: ignore-errors
"""A sensor that declares its beacon; parameters of its own, or of a file, come before the hint."""

from __future__ import annotations

import rclpy
from rclpy.executors import ExternalShutdownException

from beacon_core.hint import BeaconHint
from beacon_ros_param.beacon import declare_beacon


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("temp_sensor")
    hint = BeaconHint("temp_sensor", display_name="Temperature", metadata={"firmware": "1.2.3"})
    beacon = declare_beacon(node, hint)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        beacon.close()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
