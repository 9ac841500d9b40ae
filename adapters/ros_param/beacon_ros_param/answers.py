"""The two services that a source asks, of a node that has no others.

All that a node has by default (six for its parameters, one for its types) makes 200 nodes in one
process take 20 ms each to be created, and 400 take 90: each is announced with all the others anew.
"""

from __future__ import annotations

import time
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameters

__all__ = ["AnsweringNode"]


class AnsweringNode(Node):
    """A node whose parameters can be listed and got, as ``ros2 param list`` and ``get`` do.

    Thread rule: a node's; ``asked_ns`` from any thread.
    """

    def __init__(self, name: str, context: Context) -> None:
        super().__init__(
            name,
            context=context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self.asked_ns = 0
        """When it was last asked for its parameters, on the monotonic clock; 0: never."""
        for kind, service, answer in (
            (ListParameters, "list", self._list),
            (GetParameters, "get", self._get),
        ):
            path = f"/{name}/{service}_parameters"
            self.create_service(kind, path, answer, qos_profile=qos_profile_parameters)

    def _list(self, request: Any, response: Any) -> Any:
        self.asked_ns = time.monotonic_ns()
        response.result = self.list_parameters(request.prefixes, request.depth)
        return response

    def _get(self, request: Any, response: Any) -> Any:
        if all(map(self.has_parameter, request.names)):
            found = self.get_parameters(request.names)
            response.values = [parameter.get_parameter_value() for parameter in found]
        return response
