"""The parameters of one hint, on one node."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, Value, write
from beacon_ros.farewell import say_last
from beacon_ros_param.events import EVENTS_TOPIC

__all__ = ["Declared"]

_log = logging.getLogger(__name__)

_FAREWELL_WITHIN_S = 0.4


class Declared:
    """Thread rule: where the node's services run, or before they do: rclpy lists parameters without
    a lock, and fails if some come or go meanwhile. ``silence`` is the exception."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._said: Mapping[str, Value] = {}
        self._silent = True

    def say(self, hint: BeaconHint) -> None:
        """Declare and set what the hint gives, and undeclare what it does not.

        A value in the node's parameter file takes the place of a parameter's first one. Raises what
        rclpy does where that has another type; ``UsageError`` as ``write`` does.
        """
        parameters = write(hint)
        first = not self._said
        for name in [name for name in self._said if name not in parameters]:
            self._undeclare(name)
        changed = []
        for name, value in parameters.items():
            if self._node.has_parameter(name):
                changed.append(Parameter(name, value=value))
            else:
                self._node.declare_parameter(name, value, ignore_override=not first)
        self._said, self._silent = parameters, False
        if changed:
            self._set(changed)

    def silence(self) -> None:
        """Take the hint back: nobody is told of it any more. Thread rule: any thread.

        Emptied, not deleted, because rclpy tells everybody of a change, and nobody of a deletion.
        """
        if self._silent or not self._node.has_parameter(ENTITY_ID):
            return
        self._silent = True
        emptied = Parameter(ENTITY_ID, value="")
        if self._node.context.ok():
            self._set([emptied])
        else:
            self._tell_after_shutdown(emptied)

    def withdraw(self) -> None:
        """Take the hint back, and undeclare everything."""
        self.silence()
        for name in self._said:
            self._undeclare(name)
        self._said = {}

    def _set(self, parameters: list[Parameter]) -> None:
        result = self._node.set_parameters_atomically(parameters)
        if not result.successful:
            name = self._node.get_fully_qualified_name()
            _log.warning("%s: its own callback refuses the hint: %s", name, result.reason)

    def _tell_after_shutdown(self, parameter: Parameter) -> None:
        event = ParameterEvent(
            node=self._node.get_fully_qualified_name(),
            changed_parameters=[parameter.to_parameter_msg()],
        )
        for publisher in self._node.publishers:
            if publisher.topic_name == EVENTS_TOPIC:
                say_last(publisher, [serialize_message(event)], _FAREWELL_WITHIN_S)

    def _undeclare(self, name: str) -> None:
        if self._node.has_parameter(name):
            self._node.undeclare_parameter(name)
