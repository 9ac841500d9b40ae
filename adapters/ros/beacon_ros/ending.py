"""Ending a ROS context without being caught by a defect of Fast DDS, which would last for ever.

Theory. With its last node a context's DDS participant is destroyed, and the middleware first takes
away the participant's listener: ``DomainParticipant::set_listener(nullptr)``, without a time limit.
If Fast DDS is telling that listener of somebody's coming or going at this very moment, it waits
until that is told. The time to wait until is the last one there is; turned into a time of another
clock it overflows, the wait is refused before it gives back the mutex, and is tried again at once,
for ever. What is being told needs the same mutex. rclpy waits for all this with Python's lock held,
so the whole program stands still, one core busy. Found with a debugger after ten minutes of a
context each second, and read in the machine code of Fast DDS 2.14 (ROS 2 Jazzy).

With a time limit the same function waits as it should; and once the listener is gone there is
nothing to wait for. So it is taken away beforehand.
"""

from __future__ import annotations

import ctypes as c
from typing import Any

from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

__all__ = ["deafen"]

_WITHIN_S = 1

_PARTICIPANT_OF = "_ZN16rmw_fastrtps_cpp22get_domain_participantEP10rmw_node_s"
_SET_LISTENER = (
    "_ZN8eprosima7fastdds3dds17DomainParticipant12set_listenerE"
    "PNS1_25DomainParticipantListenerENSt6chrono8durationIlSt5ratioILl1ELl1EEEE"
)
"""``rmw_fastrtps_cpp::get_domain_participant(rmw_node_t *)``, and
``DomainParticipant::set_listener(DomainParticipantListener *, std::chrono::seconds)``: public
functions of C++, under the names that Linux's compilers give them."""


def deafen(node: Node) -> bool:
    """Let nobody's coming or going be told to this node's context any more; it is about to end.

    Call it right before the last node of a context is destroyed. ``False``: it was not possible,
    because the middleware is another than ``rmw_fastrtps_cpp`` (which need not have the defect), or
    the node was destroyed already, or what is being told has taken more than a second.
    Thread rule: any thread; Python's lock is not held while waiting.
    """
    set_listener = _found(_SET_LISTENER, [c.c_void_p, c.c_void_p, c.c_int64], c.c_uint32)
    participant_of = _found(_PARTICIPANT_OF, [c.c_void_p], c.c_void_p)
    if set_listener is None or participant_of is None:
        return False
    get_handle = c.CDLL("librcl.so").rcl_node_get_rmw_handle
    get_handle.argtypes, get_handle.restype = [c.c_void_p], c.c_void_p
    try:
        with node.handle:
            participant = participant_of(get_handle(node.handle.pointer))
            return participant is not None and set_listener(participant, None, _WITHIN_S) == 0
    except InvalidHandle:
        return False


def _found(symbol: str, argtypes: list[Any], restype: Any) -> Any:
    """The function of that name in Fast DDS or in what lies above it; ``None`` if there is none."""
    name = get_rmw_implementation_identifier()
    if name != "rmw_fastrtps_cpp":
        return None
    try:
        function = getattr(c.CDLL(f"lib{name}.so"), symbol)
    except (OSError, AttributeError):
        return None
    function.argtypes, function.restype = argtypes, restype
    return function
