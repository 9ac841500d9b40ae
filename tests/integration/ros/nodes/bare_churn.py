"""What ``churn.py`` does, with rclpy alone: what grows here too, is not ours.

As many contexts, nodes, publishers, parameters and subscriptions come and go, as often. Ends on
SIGINT or SIGTERM.
"""

from __future__ import annotations

import itertools
import signal
import threading
import time
from collections import deque

from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from beacon_ros.ending import deafen

ALIVE = 5
PERIOD_S = 1.0
TOPIC = "/bare/topic"


class Life:
    """One node that publishes and has parameters, in a context of its own, until it goes."""

    def __init__(self, number: int, *, publishes: bool = True) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False)
        self._node = Node(f"bare_{number}", context=self._context)
        if publishes:
            publisher = self._node.create_publisher(Log, TOPIC, 10)
            self._node.create_timer(0.5, lambda: publisher.publish(Log(msg="hello")))
            for one in range(12):
                self._node.declare_parameter(f"bare.parameter_{one}", "text")
        else:
            self._node.create_subscription(Log, TOPIC, lambda _: None, 10)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._ends = False
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        while not self._ends:
            self._executor.spin_once(timeout_sec=0.1)

    def end(self) -> None:
        self._ends = True
        self._thread.join()
        self._executor.shutdown()
        deafen(self._node)  # or the process may stand still: a defect of Fast DDS, described there
        self._node.destroy_node()
        self._context.try_shutdown()
        self._context.destroy()


def listen_for_a_moment(number: int) -> None:
    for _ in range(2):
        life = Life(number, publishes=False)
        time.sleep(PERIOD_S / 4)
        life.end()


def main() -> None:
    stop = threading.Event()
    for stopping in (signal.SIGINT, signal.SIGTERM):
        signal.signal(stopping, lambda *_: stop.set())
    alive: deque[Life] = deque()
    for number in itertools.count():
        alive.append(Life(number))
        if len(alive) > ALIVE:
            alive.popleft().end()
        listen_for_a_moment(number)
        if stop.wait(PERIOD_S / 2):
            break
    for life in alive:
        life.end()


main()
