# mypy: ignore-errors
# ruff: noqa: T201
"""Hears at the other end what ``relay_talker.py`` says, and prints each as a line of JSON."""

from __future__ import annotations

import json

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import String

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PIXELS = bytes(range(256)) * 4096


class Hearer(Node):
    def __init__(self) -> None:
        super().__init__("hearer")
        self._subscriptions = [
            self.create_subscription(String, "/robot/chatter", self.on_text, 1000),
            self.create_subscription(Image, "/robot/camera/image", self.on_image, 10),
            self.create_subscription(String, "/robot/map", self.on_map, LATCHED),
        ]
        print(json.dumps({"listening": True}))

    def on_text(self, text: String) -> None:
        print(json.dumps({"text": [int(one) for one in text.data.split()]}))

    def on_image(self, image: Image) -> None:
        number = int(image.header.frame_id)
        turn = number % 256
        intact = bytes(image.data) == PIXELS[turn:] + PIXELS[:turn] and image.encoding == "mono8"
        print(json.dumps({"image": number, "intact": intact}))

    def on_map(self, text: String) -> None:
        print(json.dumps({"map": text.data}))


def main() -> None:
    rclpy.init()
    node = Hearer()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
