"""A conduit over a ROS topic: frames between relays where ROS is all that connects them.

A frame is a ``std_msgs/msg/UInt8MultiArray``, so ``ros2 topic hz`` and ``bw`` work on it, and
nothing needs to be installed: it has no dimensions, the offset says how long the header is, and the
data are the header and the payload. All ends publish and listen on one topic, and know their own
frames by their GID.

Who is at the other end is told by beats, frames without a header, which each end sends twice a
second: DDS misses a process that was killed only after its lease, mostly 20 s, and one that hangs
not at all. An end that closes, or whose program ends in order, is missed at once, by DDS.
"""

from __future__ import annotations

import logging
import os
import struct
import threading
import time

from beacon_core.errors import ConfigError, UsageError
from beacon_core.ports.conduit import ConduitLimits, FrameSink
from beacon_core.relay.marks import CONDUIT_ROLE
from beacon_core.relay.values import Qos, TopicType
from beacon_ros.errors import said_by_ros
from beacon_ros.participant import OwnNode
from beacon_ros.taking import Buffer
from beacon_ros_topic.relay.hub import Hub
from beacon_ros_topic.relay.intake import Intake
from beacon_ros_topic.relay.options import RosConduitOptions
from beacon_ros_topic.relay.qos import profile
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.voice import Voice

__all__ = ["FRAME_TYPE", "LIMITS", "RosConduit"]

_log = logging.getLogger(__name__)

FRAME_TYPE = TopicType(
    "std_msgs/msg/UInt8MultiArray",
    "RIHS01_5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
)
"""What frames travel as."""

LIMITS = ConduitLimits(max_header_bytes=256 * 1024, max_payload_bytes=16 * 1024 * 1024)
"""Of a frame. DDS could carry more; so much one buffer takes."""

_TOPIC = "/frames"
_FRONT = struct.Struct("<4sIII")
_CDR = b"\0\1\0\0"
_GOODBYE = b"goodbye"
_GOODBYE_WITHIN_S = 0.2
_GOODBYE_STEP_S = 0.005
_BEAT_S = 0.5
_SILENT_S = 1.6
"""Without a beat for so long an end is gone: three were missed, and it is told within 2 s."""
_CLOSE_WITHIN_S = 0.9
_KEPT_BYTES = 32 * 1024 * 1024


class RosConduit:
    """Implements :class:`beacon_core.ports.conduit.Conduit`; the thread rule is the port's."""

    def __init__(self, options: RosConduitOptions) -> None:
        """Opens nothing."""
        self._options = options
        self._topic = options.prefix + _TOPIC
        self._pid = os.getpid()
        self._lock = threading.Lock()
        self._hub: Hub | None = None
        self._voice: Voice | None = None
        self._closed = self._up = False
        # The rest belongs to the hub's thread.
        self._heard_s: dict[bytes, float] = {}
        self._beat_due_s = 0.0

    def start(self, sink: FrameSink) -> None:
        if self._closed or self._hub is not None:
            raise UsageError("start: it was started or closed already; make a new one")
        self._sink = sink
        self._own = OwnNode(CONDUIT_ROLE, self._options.domain_id)
        self._hub = Hub(self._own.context, self._step, self._on_end)
        try:
            self._open(self._hub)
        except Exception as error:  # RCLError, which is not a public name
            said_by_ros()  # kept, it would be written to stderr when the next thing fails
            self._own.close()
            raise ConfigError(f"prefix: ROS refuses {self._topic!r}: {error}") from error
        self._hub.start()

    def send(self, header: bytes, payload: bytes) -> bool:
        large = len(header) > LIMITS.max_header_bytes or len(payload) > LIMITS.max_payload_bytes
        if large or not self._up or self._closed or self._pid != os.getpid():
            return False
        return self._say(_written(header, payload))

    def limits(self) -> ConduitLimits:
        return LIMITS

    def close(self) -> None:
        if self._pid != os.getpid():
            return  # in a forked child, which has none of the threads
        self._closed = True
        if self._hub is not None:
            self._hub.close(_CLOSE_WITHIN_S)

    def _open(self, hub: Hub) -> None:
        qos = profile(Qos(reliable=True, durable=False, depth=self._options.depth), 1)
        of, buffer = type_for(FRAME_TYPE), Buffer(_KEPT_BYTES)
        self._intake = Intake(self._own.node, of, self._topic, qos, buffer, self._message)
        self._voice = Voice(self._own.node, of, self._topic, qos, hub.add(self._beat))
        self._gid = self._voice.gid
        self._intake.open(hub)

    def _say(self, message: bytes) -> bool:
        """Under the lock, so that the publisher is not ended meanwhile."""
        with self._lock:
            if self._voice is None:
                return False
            try:
                self._voice.send(message)
            except RuntimeError as error:
                _log.warning("%s: %s", self._topic, error)
                return False
            return True

    # -- in the hub's thread ---------------------------------------------------------------------

    def _message(self, message: bytes, gid: bytes, _: int) -> None:
        if gid == self._gid:
            return
        frame = _read(message)
        if frame is None:
            return
        header, payload = frame
        if not header and payload == _GOODBYE:
            self._heard_s.pop(gid, None)
            self._tell_link()
            return
        self._heard_s[gid] = time.monotonic()
        self._tell_link()
        if header:
            self._sink.frame(header, payload)

    def _step(self) -> float | None:
        now_s = time.monotonic()
        if now_s >= self._beat_due_s:
            self._beat()
        silent = [gid for gid, heard_s in self._heard_s.items() if now_s - heard_s >= _SILENT_S]
        for gid in silent:
            del self._heard_s[gid]
        self._tell_link()
        missed_s = min(self._heard_s.values(), default=now_s) + _SILENT_S
        return min(self._beat_due_s, missed_s) - now_s

    def _beat(self) -> bool:
        """Also when somebody has come: then the link is up at once."""
        self._beat_due_s = time.monotonic() + _BEAT_S
        self._say(_written(b"", b""))
        return False

    def _tell_link(self) -> None:
        up = bool(self._heard_s)
        if up is not self._up and not self._closed:
            self._up = up
            self._sink.link(up=up)

    def _on_end(self) -> None:
        self._up = False
        self._intake.close()
        self._say(_written(b"", _GOODBYE))
        deadline = time.monotonic() + _GOODBYE_WITHIN_S
        with self._lock:
            voice, self._voice = self._voice, None
        if voice is not None:
            while not voice.acknowledged() and time.monotonic() < deadline:
                time.sleep(_GOODBYE_STEP_S)
            voice.close()
        self._own.close()


def _written(header: bytes, payload: bytes) -> bytes:
    size = len(header) + len(payload)
    return b"".join((_FRONT.pack(_CDR, 0, len(header), size), header, payload))


def _read(message: bytes) -> tuple[bytes, bytes] | None:
    """Header and payload; ``None`` if this is no frame."""
    if len(message) < _FRONT.size:
        return None
    cdr, dimensions, header_bytes, size = _FRONT.unpack_from(message)
    end = _FRONT.size + size
    # Some middleware pads to four bytes.
    if cdr[:2] != _CDR[:2] or dimensions or header_bytes > size or len(message) < end:
        return None
    middle = _FRONT.size + header_bytes
    return message[_FRONT.size : middle], message[middle:end]
