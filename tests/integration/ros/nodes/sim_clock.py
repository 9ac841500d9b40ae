# mypy: ignore-errors
"""A simulator's clock: one hundred seconds after the beginning of time, and running."""

from __future__ import annotations

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rosgraph_msgs.msg import Clock


class SimClock(Node):
    def __init__(self) -> None:
        super().__init__("sim_clock")
        self._publisher = self.create_publisher(Clock, "/clock", 10)
        self._ticks = 100 * 50
        self._timer = self.create_timer(1 / 50, self.tick)

    def tick(self) -> None:
        self._ticks += 1
        clock = Clock()
        clock.clock.sec, rest = divmod(self._ticks, 50)
        clock.clock.nanosec = rest * 20_000_000
        self._publisher.publish(clock)


def main() -> None:
    rclpy.init()
    node = SimClock()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
