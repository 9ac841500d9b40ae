"""Nodes that come and go every second, each in a ROS context of its own, in every way there is.

And beside them, unless told to ``speak-only``, sources, as a gateway embeds them, which are opened
and closed as often. Told to ``return``, nodes come back under the names of those who left;
otherwise (``new``) each has a name that nobody had. Ends on SIGINT or SIGTERM.
"""

from __future__ import annotations

import itertools
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable

import attrs
from rclpy.context import Context
from rclpy.node import Node

from beacon_core.clock import SystemClock
from beacon_core.hint import BeaconHint
from beacon_core.intake import Intake
from beacon_core.store import HintStore
from beacon_ros.ending import deafen
from beacon_ros.spinner import Spinner
from beacon_ros_param import ADAPTER as PARAM
from beacon_ros_param.beacon import declare_beacon
from beacon_ros_topic import ADAPTER as TOPIC
from beacon_ros_topic.beacon import TopicBeacon

ALIVE = 5
PERIOD_S = 1.0
NAMES = 50 if "return" in sys.argv else sys.maxsize
ROLE = "victim" if "speak-only" in sys.argv else "churn"


@attrs.frozen
class Life:
    """One node with both kinds of beacon, until it goes."""

    context: Context
    node: Node
    spinner: Spinner
    goodbyes: tuple[Callable[[], object], ...]

    @classmethod
    def begin(cls, number: int) -> Life:
        context = Context()
        context.init(args=[], initialize_logging=False)
        node = Node(f"{ROLE}_{number % NAMES}", context=context)
        topic = TopicBeacon(node, BeaconHint(f"by_topic_{number % 20}"), period_s=0.5)
        parameters = declare_beacon(node, BeaconHint(f"by_param_{number % 20}"))
        spinner = Spinner(context, node)
        return cls(context, node, spinner, (topic.close, parameters.close))

    def end(self, number: int) -> None:
        """Every second one says goodbye, the others leave it to ROS."""
        if number % 2:
            for say_goodbye in self.goodbyes:
                say_goodbye()
        assert self.spinner.close(5.0)
        deafen(self.node)  # or the process may stand still: a defect of Fast DDS, described there
        self.node.destroy_node()
        self.context.try_shutdown()
        self.context.destroy()


def listen_for_a_moment(stop: threading.Event) -> None:
    """Open a source of each kind, and close it."""
    for adapter in (TOPIC, PARAM):
        source = adapter.source(adapter.options())
        source.start(Intake(HintStore(SystemClock()), adapter.decode))
        stop.wait(PERIOD_S / 4)
        source.close()


def main() -> None:
    stop = threading.Event()
    for stopping in (signal.SIGINT, signal.SIGTERM):
        signal.signal(stopping, lambda *_: stop.set())
    alive: deque[Life] = deque()
    for number in itertools.count():
        alive.append(Life.begin(number))
        if len(alive) > ALIVE:
            alive.popleft().end(number)
        if ROLE == "churn":
            listen_for_a_moment(stop)
        if stop.wait(PERIOD_S / 2):
            break
    for life in alive:
        life.end(os.getpid())


main()
