"""Many ordinary nodes in one process, each with a beacon: ``many_nodes.py FIRST COUNT [DELAY]``.

``DELAY``: each takes so many seconds to answer, but they do so side by side.
"""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node

from beacon_core.hint import BeaconHint
from beacon_ros_param.beacon import declare_beacon


class SlowNode(Node):
    delay_s = 0.0

    def list_parameters(self, prefixes: list[str], depth: int) -> Any:
        time.sleep(self.delay_s)
        return super().list_parameters(prefixes, depth)


def main() -> None:
    first, count = map(int, sys.argv[1:3])
    SlowNode.delay_s = float(sys.argv[3]) if sys.argv[3:] else 0.0
    rclpy.init()
    executor = MultiThreadedExecutor(num_threads=count)
    for number in range(first, first + count):
        node = SlowNode(f"one_of_many_{number}")
        declare_beacon(node, BeaconHint(f"one_of_many_{number}", metadata={"number": f"{number}"}))
        executor.add_node(node)
    print('{"ready": true}', flush=True)  # noqa: T201
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main()
