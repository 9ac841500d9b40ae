"""The receiving end of the fake network."""

from __future__ import annotations

import logging
import threading

from beacon_core.errors import UsageError
from beacon_core.ports.health import Condition, Health
from beacon_core.ports.sink import HintSink
from beacon_fake.message import Kind, Message
from beacon_fake.network import FakeNetwork

__all__ = ["FakeSource"]

_log = logging.getLogger(__name__)

_CLOSE_WITHIN_S = 1.0


class FakeSource:
    """Listens on a :class:`FakeNetwork`; see the ``HintSource`` port for what that promises.

    The sink is called by whoever drives the network, so one call at a time.
    """

    def __init__(self, network: FakeNetwork, name: str = "") -> None:
        self.name = network.free_name(name, "source")
        self._network = network
        self._sink: HintSink | None = None
        self._closed = False
        self._calls = self._faults = 0
        self._caller: int | None = None
        """The thread in which the sink is being called."""
        self._changed = threading.Condition()

    def start(self, sink: HintSink) -> None:
        with self._changed:
            if self._closed:
                raise UsageError("start: this source has been closed; make a new one")
            if self._sink is not None:
                raise UsageError("start: this source has been started before")
            self._network.join_receiver(self)
            self._sink = sink

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.wait_for(self._no_call_elsewhere, _CLOSE_WITHIN_S)
        self._network.leave(self)

    def health(self) -> Health:
        with self._changed:
            condition, detail = self._condition()
            counters = {"calls": self._calls, "sink-faults": self._faults}
        return Health(condition, detail, counters)

    def receive(self, message: Message) -> None:
        """Hand one message to the sink; called by the network."""
        with self._changed:
            if self._closed or self._sink is None:
                return
            sink, self._caller = self._sink, threading.get_ident()
            self._calls += 1
        try:
            _hand_in(message, sink)
        except Exception:  # noqa: BLE001 - whatever a sink does, the next message is delivered
            self._note_fault()
        finally:
            with self._changed:
                self._caller = None
                self._changed.notify_all()

    def _note_fault(self) -> None:
        with self._changed:
            self._faults += 1
            first = self._faults == 1
        if first:
            _log.exception("%s: the sink raised; further faults are only counted", self.name)

    def _no_call_elsewhere(self) -> bool:
        return self._caller in (None, threading.get_ident())

    def _condition(self) -> tuple[Condition, str]:
        if self._closed:
            return Condition.CLOSED, ""
        if self._sink is None:
            return Condition.STARTING, "not started yet"
        if self._faults:
            return (
                Condition.DEGRADED,
                f"the sink raised {self._faults} times; the log has the first",
            )
        complaint = self._network.complaint()
        return (Condition.DEGRADED if complaint else Condition.UP), complaint


def _hand_in(message: Message, sink: HintSink) -> None:
    source, incarnation = message.sender, message.incarnation
    if message.kind is Kind.HINT:
        sink.offer(
            message.payload,
            source,
            entity_id=message.entity_id,
            stamp_ns=message.stamp_ns,
            incarnation=incarnation,
            sequence=message.sequence,
        )
    elif message.kind is Kind.GOODBYE:
        sink.goodbye(message.entity_id, source, incarnation=incarnation, sequence=message.sequence)
    else:
        sink.lost(message.entity_id, source, incarnation=incarnation)
