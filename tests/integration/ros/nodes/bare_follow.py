"""Asks each node of the graph for its parameters each second, with rclpy alone.

As the gateway does, and with the same care for its heaps: two clients for each node, destroyed when
the node has gone. What it grows by, is what whoever asks nodes by rclpy has to grow by. Ends on
SIGINT or SIGTERM.
"""

from __future__ import annotations

import signal
import threading
import time

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from beacon_gateway.console.process import keep_memory_together, memory_given_back

EACH_S = 1.0
NAMES = ["ros2_medkit.discovery.entity_id"]


class Follower:
    """A node with clients for all others."""

    def __init__(self) -> None:
        self._context = Context()
        self._context.init(args=[], initialize_logging=False)
        self._node = Node("_bare_follow", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._clients: dict[str, tuple[Client, Client]] = {}
        self._asked: list[tuple[Client, Future]] = []

    def follow(self) -> None:
        """Look who is there, and ask them; who has not answered by now is not waited for."""
        while self._asked:
            client, future = self._asked.pop()
            client.remove_pending_request(future)
        found = self._node.get_node_names_and_namespaces()
        names = {f"{space.rstrip('/')}/{name}" for name, space in found if name[0] != "_"}
        for name in self._clients.keys() - names:
            for client in self._clients.pop(name):
                self._node.destroy_client(client)
        for name in names - self._clients.keys():
            self._clients[name] = (
                self._node.create_client(ListParameters, f"{name}/list_parameters"),
                self._node.create_client(GetParameters, f"{name}/get_parameters"),
            )
        for listing, getting in self._clients.values():
            if listing.service_is_ready() and getting.service_is_ready():
                self._ask(listing, ListParameters.Request())
                self._ask(getting, GetParameters.Request(names=NAMES))

    def _ask(self, client: Client, request: object) -> None:
        self._asked.append((client, client.call_async(request)))

    def spin(self) -> None:
        self._executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()
        self._context.destroy()


def main() -> None:
    stop = threading.Event()
    for stopping in (signal.SIGINT, signal.SIGTERM):
        signal.signal(stopping, lambda *_: stop.set())
    keep_memory_together()
    follower, due_s = Follower(), time.monotonic()
    with memory_given_back():
        while not stop.is_set():
            if time.monotonic() >= due_s:
                due_s += EACH_S
                follower.follow()
            follower.spin()
    follower.close()


main()
