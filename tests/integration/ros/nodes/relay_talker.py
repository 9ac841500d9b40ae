# mypy: ignore-errors
# ruff: noqa: T201
"""A robot as anybody would write it: text fast, images of 1 MiB, and a map for who comes late.

``-p life:=N`` is said with each text, ``-p period_s:=0.02`` is the pace; without images if
``-p images:=false``. How many texts it has said is printed as it goes.
"""

from __future__ import annotations

import json

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PIXELS = bytes(range(256)) * 4096


class Talker(Node):
    def __init__(self) -> None:
        super().__init__("talker")
        self._life = self.declare_parameter("life", 1).value
        period_s = self.declare_parameter("period_s", 0.05).value
        images = self.declare_parameter("images", True).value
        self._chatter = self.create_publisher(String, "/chatter", 100)
        self._map = self.create_publisher(String, "/map", LATCHED)
        self._map.publish(String(data=f"the map of life {self._life}"))
        self._said = self._shown = 0
        self._talk = self.create_timer(period_s, self.talk)
        if images:
            self._camera = self.create_publisher(Image, "/camera/image", 10)
            self._show = self.create_timer(0.2, self.show)

    def talk(self) -> None:
        self._chatter.publish(String(data=f"{self._life} {self._said}"))
        self._said += 1
        if self._said % 10 == 0:
            print(json.dumps({"said": self._said}))

    def show(self) -> None:
        image = Image(height=1024, width=1024, step=1024, encoding="mono8")
        image.header.frame_id = str(self._shown)
        turn = self._shown % 256
        image.data = PIXELS[turn:] + PIXELS[:turn]
        self._camera.publish(image)
        self._shown += 1


def main() -> None:
    rclpy.init()
    node = Talker()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
