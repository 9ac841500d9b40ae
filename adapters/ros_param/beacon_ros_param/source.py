"""The receiving half: nodes are asked for their parameters, and what follows goes to a sink."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Mapping

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events

from beacon_core.errors import ConfigError, UsageError
from beacon_core.parameters.asker import Asker
from beacon_core.parameters.complaints import complaints
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_ros.graph import node_names
from beacon_ros.participant import OwnNode
from beacon_ros.reader import Reader
from beacon_ros.spinner import Spinner
from beacon_ros.waiter import Waiter
from beacon_ros_param.clients import RosClients
from beacon_ros_param.events import EVENTS_TOPIC, change_in, runs
from beacon_ros_param.options import RosParamOptions

__all__ = ["RosParamSource"]

_log = logging.getLogger(__name__)

_CLOSE_WITHIN_S = 0.9
"""How long ``close`` waits for the sink."""

_RELEASE_WITHIN_S = 0.5
"""And for the clients of all nodes to be destroyed: the 400 of 200 nodes take about as long. What
takes longer goes on when ``close`` has returned."""

_MS = 1_000_000

_GLANCE_EVERY_NS = 1000 * _MS
"""How often the names in the graph are looked at; at a shorter interval, once in that. Takes 0.1 ms
for 200 nodes."""

_LOOK_AFTER_NS = (0, 100 * _MS, 500 * _MS)
"""When GIDs are looked up after a node came or went: names may lag behind what happened, and GIDs
behind the names. Besides, as often as the names, or at a longer interval, once in that: nobody else
tells that a node was started again. Takes 4 ms for 200 nodes."""

_LOOK_AT_MOST_EVERY_NS = 100 * _MS
"""However many events tell of nodes that nobody has seen."""


class RosParamSource:
    """Implements :class:`beacon_core.ports.source.HintSource`,
    :class:`beacon_core.ports.targeted.Targeted` and :class:`beacon_core.ports.graph.Graph`; the
    thread rules are the ports'.

    The sink's ``source`` is the node's full name. Without SROS2 any process may take any name.
    One thread of its own asks, and calls the sink; so a sink that is slow slows down the asking.
    """

    def __init__(self, options: RosParamOptions, *, node: Node | None = None) -> None:
        """Opens nothing. ``node``: one of your own to join, which you spin, and which must live
        until ``close`` has returned; without, it has a hidden one, and spins it itself."""
        self._options = options
        self._given_node = node
        self._targets: frozenset[str] | None = None
        self._retargeted = False
        self._starting = threading.Lock()
        self._pid = os.getpid()
        self._closed = False
        self._ended = ""
        self._done_telling = threading.Event()
        self._absent: tuple[str, ...] = ()
        self._nodes: frozenset[str] = frozenset()
        self._events = 0
        self._own: OwnNode | None = None
        self._spinner: Spinner | None = None
        self._asker: Asker | None = None
        self._waiter: Waiter | None = None
        # The rest belongs to the waiter's thread.
        self._looks: list[int] = [0]
        self._glance_ns = self._looked_ns = 0
        self._runs: Mapping[str, set[str]] = {}
        if options.budget_s <= options.timeout_s:
            _log.warning(
                "budget_s: %g is not above timeout_s (%g): one node that hangs ends the round",
                options.budget_s,
                options.timeout_s,
            )

    def start(self, sink: HintSink) -> None:
        with self._starting:
            if self._closed or self._waiter is not None:
                raise UsageError("start: it was started or closed already; make a new one")
            self._node = self._given_node or self._new_node()
            clients, now_ns = RosClients(self._node), time.monotonic_ns()
            try:
                waiter = self._new_waiter()
            except Exception as error:  # RCLError, which is not a public name
                self._release()
                raise ConfigError(f"node: ROS refuses it: {error}") from error
            self._asker = Asker(self._options, clients, sink, self._wake, now_ns)
            self._waiter = waiter
            waiter.start()

    def close(self) -> None:
        if self._pid != os.getpid():
            return  # in a forked child: it has none of the threads, and perhaps a lock that is held
        with self._starting:
            self._closed = True
        if self._asker is None or self._waiter is None:
            return
        self._asker.stop()
        until_s = time.monotonic() + _RELEASE_WITHIN_S
        if not self._waiter.close(0.0):
            self._done_telling.wait(_CLOSE_WITHIN_S)
            self._waiter.close(max(0.0, until_s - time.monotonic()))

    def set_targets(self, nodes: frozenset[str] | None) -> None:
        """See the port; ``targets`` in the options come first."""
        self._targets, self._retargeted = nodes, True
        self._wake()

    def nodes(self) -> frozenset[str]:
        """See the port; at most a second old."""
        return frozenset() if self._closed or self._ended else self._nodes

    def health(self) -> Health:
        asker = self._asker
        counters = {} if asker is None else {**asker.counters(), "events": self._events}
        if self._closed:
            return Health(Condition.CLOSED, counters=counters)
        if asker is None:
            return Health(Condition.STARTING, counters=counters)
        if self._ended:
            return Health(Condition.DOWN, f"{self._ended}; start the gateway again", counters)
        detail = complaints(asker.silent(), self._absent, asker.namesakes)
        return Health(Condition.DEGRADED if detail else Condition.UP, detail, counters)

    def _new_node(self) -> Node:
        self._own = OwnNode("param_source", self._options.domain_id)
        self._spinner = Spinner(self._own.context, self._own.node)
        return self._own.node

    def _new_waiter(self) -> Waiter:
        if not self._options.parameter_events:
            return Waiter(self._node.context, self.step, self.on_end)
        return Reader(self._node, ParameterEvent, EVENTS_TOPIC, qos_profile_parameter_events, self)

    def _wake(self) -> None:
        if self._waiter is not None:
            self._waiter.wake()

    # -- in the waiter's thread ------------------------------------------------------------------

    def on_message(self, payload: bytes, gid: bytes, sequence: int, stamp_ns: int) -> None:  # noqa: ARG002 - the reader's owner's
        """An event: somebody's parameters have changed."""
        change = change_in(payload)
        if change is None or self._asker is None:
            return
        self._events += 1
        known = self._asker.changed(change.node, time.monotonic_ns(), leaving=change.leaving)
        if not known and change.node not in self._runs:
            self._look_soon()

    def on_matched(self, publishers: int) -> None:  # noqa: ARG002 - the same
        """A node came or went."""
        self._look_soon()

    def on_incompatible(self, total: int) -> None:
        """Somebody's events cannot be heard, because of its QoS: then it is asked like others."""

    def step(self) -> float | None:
        """Look at the graph when that is due, and ask whom the plan says."""
        asker = self._asker
        if asker is None or self._closed:
            return None
        now_ns = time.monotonic_ns()
        if self._retargeted or now_ns >= min(self._glance_ns, self._looks[0]):
            self._look(asker, now_ns)
        due_ns = min(asker.step(now_ns), self._glance_ns, self._looks[0])
        return max(0.0, (due_ns - time.monotonic_ns()) / 1e9)

    def on_end(self, error: str) -> None:
        """The last call."""
        self._ended = error
        self._done_telling.set()
        if error:
            _log.error("asking nodes for their parameters ended: %s", error)
        self._release()

    def _release(self) -> None:
        if self._spinner is not None:
            self._spinner.close(_CLOSE_WITHIN_S)
        try:
            if self._asker is not None:
                self._asker.close()
        except Exception:  # noqa: BLE001 - a node that was destroyed has taken its clients along
            _log.debug("clients could not be closed", exc_info=True)
        if self._own is not None:
            self._own.close()

    def _look_soon(self) -> None:
        first_ns = max(time.monotonic_ns(), self._looked_ns + _LOOK_AT_MOST_EVERY_NS)
        self._looks = [first_ns + after_ns for after_ns in _LOOK_AFTER_NS]

    def _look(self, asker: Asker, now_ns: int) -> None:
        interval_ns = round(self._options.interval_s * 1e9)
        self._glance_ns = now_ns + min(_GLANCE_EVERY_NS, interval_ns)
        self._retargeted = False
        names = frozenset(node_names(self._node))
        if names != self._nodes:
            self._nodes = names
        if names != self._runs.keys():
            self._looks = [now_ns + after_ns for after_ns in _LOOK_AFTER_NS]
        if now_ns >= self._looks[0]:
            self._looked_ns = now_ns
            self._looks = self._looks[1:] or [now_ns + max(_GLANCE_EVERY_NS, interval_ns)]
            self._runs = runs(self._node)
        given = self._options.targets or self._targets
        self._absent = tuple(n for n in self._options.targets if n not in self._runs)
        asker.see(self._runs, self._all_visible() if given is None else given, now_ns)

    def _all_visible(self) -> list[str]:
        mine = self._node.get_fully_qualified_name()
        return [name for name in self._runs if name != mine and name.rpartition("/")[2][:1] != "_"]
