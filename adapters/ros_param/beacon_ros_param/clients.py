"""Asking nodes for their parameters by the services that ROS nodes have for that.

The services' own client in rclpy makes six service clients per node, of which two are needed here;
the others would cost 115 kB and a millisecond each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameters
from rclpy.task import Future

from beacon_core.parameters.fields import PREFIX
from beacon_core.ports.asking import Done, Drop, NodeClient

__all__ = ["RosClients"]


class RosClients:
    """A :data:`.asking.ClientFactory`: asks by a ROS node, which must be spun.

    Thread rule: as the client's.
    """

    def __init__(self, node: Node) -> None:
        self._node = node

    def __call__(self, name: str) -> NodeClient:
        return _RosClient(self._node, name)


class _RosClient:
    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        # Not the node's own group: answers must not wait for another callback of the node. And one
        # for each client, since a group never forgets whom it had.
        group = ReentrantCallbackGroup()
        self._clients: list[Client] = []
        for kind, service in ((ListParameters, "list"), (GetParameters, "get")):
            client = node.create_client(
                kind,
                f"{name}/{service}_parameters",
                qos_profile=qos_profile_parameters,
                callback_group=group,
            )
            self._clients.append(client)
        self._list, self._get = self._clients

    def ready(self) -> bool:
        return all(client.service_is_ready() for client in self._clients)

    def list_names(self, done: Done) -> Drop:
        request = ListParameters.Request(prefixes=[PREFIX])
        return _send(self._list, request, lambda answer: done(answer.result.names), done)

    def get_values(self, names: Sequence[str], done: Done) -> Drop:
        request = GetParameters.Request(names=list(names))
        return _send(
            self._get,
            request,
            lambda answer: done([parameter_value_to_python(one) for one in answer.values]),
            done,
        )

    def close(self) -> None:
        for client in self._clients:
            self._node.destroy_client(client)


def _send(client: Client, request: Any, answered: Callable[[Any], None], done: Done) -> Drop:
    def finished(future: Future) -> None:
        if future.exception() is None:
            answered(future.result())
        else:
            done(None)

    future = client.call_async(request)
    future.add_done_callback(finished)
    return partial(client.remove_pending_request, future)
