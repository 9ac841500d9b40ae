"""A beacon for one node: its hint as its own parameters, which anybody may look at and set."""

from __future__ import annotations

import logging
import os
import threading

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.timer import Timer

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.validator import require_id
from beacon_ros.participant import NO_FORK
from beacon_ros.process import identified
from beacon_ros_param.declared import Declared

__all__ = ["ParamBeacon", "declare_beacon"]

_log = logging.getLogger(__name__)


def declare_beacon(node: Node, hint: BeaconHint) -> ParamBeacon:
    """Say this of the node, in parameters ``ros2_medkit.discovery.*``.

    ::

        beacon = declare_beacon(node, BeaconHint("engine_temp", depends_on=("engine",)))

    Process id, process name and hostname are this process's unless the hint gives them. Values in
    the node's parameter file come before those of the hint; and what somebody sets later, as with
    ``ros2 param set``, is what a gateway sees from then on.

    Raises ``UsageError`` for an entity id that is none, and for a process id outside 0..2^32-1.
    """
    return ParamBeacon(node, hint)


class ParamBeacon:
    """What :func:`declare_beacon` returns. It says what it says as long as the node is spun.

    Thread rule: any thread. Once the node has an executor, changes take effect in its turn, between
    two callbacks of the node.
    """

    def __init__(self, node: Node, hint: BeaconHint) -> None:
        """See :func:`declare_beacon`."""
        self._node = node
        self._declared = Declared(node)
        # A callback of the node for set parameters may come back to us.
        self._lock = threading.RLock()
        self._hint: BeaconHint | None = _checked(hint)
        self._closed = False
        self._pid = os.getpid()
        self._in_turn()

    def update(self, hint: BeaconHint) -> None:
        """Say this instead; what the new hint does not give is no longer said.

        Raises ``UsageError`` as :func:`declare_beacon` does, after ``close``, and in a forked
        child.
        """
        hint = _checked(hint)
        if self._pid != os.getpid():
            raise UsageError(f"update: made before a fork; {NO_FORK}")
        with self._lock:
            if self._closed:
                raise UsageError("update: this beacon is closed; declare a new one")
            self._hint = hint
        self._in_turn()

    def close(self) -> None:
        """Take the hint back, which is a goodbye, and undeclare its parameters. Idempotent, and in
        a forked child it does nothing.

        A gateway that listens to parameter events hears it at once, also if the node is destroyed
        right after, and if ROS was shut down before; another one at its next poll.
        """
        if self._pid != os.getpid():
            return
        with self._lock:
            if self._closed:
                return
            self._closed, self._hint = True, None
        try:
            self._declared.silence()
            self._in_turn()
        except Exception:  # noqa: BLE001 - whatever rclpy raises of a node that is gone
            _log.debug("the node went before its beacon", exc_info=True)

    def _in_turn(self) -> None:
        """Apply what is wanted where no other callback of the node runs at the same time.

        rclpy has no way to hand work to an executor that heeds callback groups, but for timers. Its
        clock is steady, for simulated time may stand still.
        """
        if self._node.executor is None:
            self._apply()
            return
        timers: list[Timer] = []

        def once() -> None:
            with self._lock:
                (timer,) = timers
            timer.cancel()
            self._node.destroy_timer(timer)
            try:
                self._apply()
            except Exception:  # noqa: BLE001 - it would end the program that spins the node
                _log.exception("%s: its hint is not declared", self._node.get_name())

        with self._lock:
            timers.append(self._node.create_timer(0.0, once, clock=_STEADY))

    def _apply(self) -> None:
        with self._lock:
            if self._hint is None:
                self._declared.withdraw()
            else:
                self._declared.say(self._hint)


_STEADY = Clock(clock_type=ClockType.STEADY_TIME)


def _checked(hint: BeaconHint) -> BeaconHint:
    require_id(hint.entity_id)
    return identified(hint)
