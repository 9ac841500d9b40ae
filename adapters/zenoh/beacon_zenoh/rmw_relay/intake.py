"""One subscription of raw bytes, whose messages come with their publisher's GID.

Zenoh leaves them here, in a thread of its own that must not wait; the teller takes them. What waits
is bounded, and the oldest gives way, as in ROS.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable

import attrs
import zenoh
import zenoh.ext
from zenoh.handlers import Callback

from beacon_core.relay.effects import Subscribe
from beacon_zenoh.rmw.attachment import decode
from beacon_zenoh.rmw.keys import DataKey, data_key
from beacon_zenoh.rmw_relay.repeats import Numbers, Stamps
from beacon_zenoh.rmw_relay.station import Part, Station
from beacon_zenoh.rmw_relay.teller import Teller

__all__ = ["MOST_WAITING", "MOST_WAITING_BYTES", "Intake"]

_log = logging.getLogger(__name__)

MOST_WAITING = 1_000
"""Messages of one topic. A watcher takes 10 us for one."""

MOST_WAITING_BYTES = 64 * 1024 * 1024
"""The same; but one may always wait."""

_MAX_BATCH = 64
"""Messages of one topic told before other topics get their turn."""

_REMOTE = zenoh.Locality.REMOTE

_Deliver = Callable[[Subscribe, bytes, bytes, int], object]
"""What it is of, the publisher's GID, the payload, the publisher's stamp."""


@attrs.define
class _Waiting:
    samples: deque[zenoh.Sample] = attrs.field(factory=deque)
    size: int = 0

    def add(self, sample: zenoh.Sample) -> int:
        """Says how many had to give way."""
        self.samples.append(sample)
        self.size += len(sample.payload)
        before = len(self.samples)
        while len(self.samples) > MOST_WAITING or (
            self.size > MOST_WAITING_BYTES and len(self.samples) > 1
        ):
            self.take()
        return before - len(self.samples)

    def take(self) -> zenoh.Sample:
        sample = self.samples.popleft()
        self.size -= len(sample.payload)
        return sample


class Intake:
    """Thread rule: ``open`` and ``close`` one at a time, from any thread."""

    def __init__(self, what: Subscribe, teller: Teller, deliver: _Deliver) -> None:
        """``deliver`` is called by the teller."""
        self.what = what
        self.dropped = self.refused = 0
        """Messages that came too fast; and those without the attachment of rmw_zenoh. The first of
        each is logged."""
        self._teller, self._deliver = teller, deliver
        self._lock = threading.Lock()
        self._waiting = _Waiting()
        self._scheduled = self._closed = False
        self._numbers, self._stamps = Numbers(), Stamps()
        self._station: Station | None = None
        self._part: Part | None = None
        self._subscriber: zenoh.Subscriber[None] | zenoh.ext.AdvancedSubscriber[None] | None = None

    def open(self, station: Station, domain: int) -> None:
        """Listen on this session; an earlier one is about to be closed."""
        of = self.what.type
        key = data_key(DataKey(domain, self.what.topic, of.name, of.digest))
        handler = Callback(self._take, indirect=False)
        if self.what.qos.durable:
            self._subscriber = zenoh.ext.declare_advanced_subscriber(
                station.session,
                key,
                handler,
                allowed_origin=_REMOTE,
                history=zenoh.ext.HistoryConfig(
                    detect_late_publishers=True, max_samples=self.what.qos.depth
                ),
                recovery=zenoh.ext.RecoveryConfig(heartbeat=True, periodic_queries=None),
            )
        else:
            self._subscriber = station.session.declare_subscriber(
                key, handler, allowed_origin=_REMOTE
            )
        # Last: whoever sees it may speak.
        self._station, self._part = station, station.subscription(self.what)

    def silence(self) -> None:
        """Tell nothing any more."""
        self._closed = True

    def close(self) -> None:
        """The same, and listen no more."""
        self.silence()
        if self._station is not None and self._part is not None and self._subscriber is not None:
            self._station.end(self._part)
            self._subscriber.undeclare()  # type: ignore[no-untyped-call]

    # -- in a receiving thread of Zenoh's

    def _take(self, sample: zenoh.Sample) -> None:
        with self._lock:
            if self._closed:
                return
            dropped = self._waiting.add(sample)
            if dropped and not self.dropped:
                _log.warning("%s: more comes than is taken; the oldest gives way", self.what.topic)
            self.dropped += dropped
            if self._scheduled:
                return
            self._scheduled = True
        self._teller.tell(self._drain)

    # -- in the teller's thread

    def _drain(self) -> None:
        for _ in range(_MAX_BATCH):
            with self._lock:
                if self._closed or not self._waiting.samples:
                    self._scheduled = False
                    return
                sample = self._waiting.take()
            self._tell(sample)
        self._teller.tell(self._drain)

    def _tell(self, sample: zenoh.Sample) -> None:
        attachment = sample.attachment
        envelope = None if attachment is None else decode(attachment.to_bytes())
        if envelope is None:
            if not self.refused:
                _log.warning("%s: a message that rmw_zenoh did not send", self.what.topic)
            self.refused += 1
            return
        gid, sequence, stamp_ns = envelope
        if self._is_new(sample, gid, sequence):
            self._deliver(self.what, gid, sample.payload.to_bytes(), stamp_ns)

    def _is_new(self, sample: zenoh.Sample, gid: bytes, sequence: int) -> bool:
        if self.what.qos.durable and sample.timestamp is not None:
            return self._stamps.is_new(str(sample.timestamp))
        return self._numbers.is_new(gid, sequence)
