"""Compression of what a conduit carries, per route, where it gains.

Theory. Whether a topic's messages can be compressed, only trying tells: text and maps shrink to a
fifth, a camera's JPEG not at all. So of each route the first messages are compressed; if they have
not become smaller by a sixth, the route is left alone for a thousand messages, and then tried
again. One that gains is looked at again each thousand::

    TRYING --20 messages, ratio >= 1.2--> GAINS --1000 messages, ratio < 1.2--> LEFT
    TRYING --20 messages, ratio < 1.2 --> LEFT  --1000 messages--> TRYING

A content's header has a byte of flags that are all 0; the highest says here that the payload is
compressed, and is taken away again at the other end, before a core sees it. An end always takes
what is compressed, whether or not it compresses itself.

Zstandard, level 1: 0.2 to 0.3 ms for 1 MiB, outside of Python's lock.
"""

from __future__ import annotations

import logging
from collections import OrderedDict

import attrs
import zstandard

from beacon_core.ports.conduit import Conduit, ConduitLimits, FrameSink
from beacon_core.relay.frames import CONTENT, FLAGS_AT, HEADER_BYTES, KIND_AT, ROUTE_AT

__all__ = ["SqueezingConduit"]

_log = logging.getLogger(__name__)

_SQUEEZED = 0x80

_LEAST_BYTES = 128
"""A smaller payload gains nothing that is worth the call."""

_TRIED, _LEFT_ALONE = 20, 1000
_GAIN = 1.2
_MAX_ROUTES = 4096
"""Remembered; who is not sent for longest, is forgotten."""


class SqueezingConduit:
    """A conduit around another one. Thread rule: the port's; ``send`` from one thread at a time."""

    def __init__(self, inner: Conduit, *, squeezes: bool, level: int = 1) -> None:
        """``squeezes``: compress what is sent, too."""
        self._inner = inner
        self._squeezes = squeezes
        self._compress = zstandard.ZstdCompressor(level=level).compress
        self._routes: OrderedDict[bytes, _Trial] = OrderedDict()

    def start(self, sink: FrameSink) -> None:
        """See the port."""
        self._inner.start(_Unpacking(sink, self._inner.limits().max_payload_bytes))

    def send(self, header: bytes, payload: bytes) -> bool:
        """See the port."""
        if (
            self._squeezes
            and len(payload) >= _LEAST_BYTES
            and header[KIND_AT] == CONTENT
            and (trial := self._trial_of(header[ROUTE_AT])).wants()
        ):
            squeezed = self._compress(payload)
            trial.judge(len(payload), len(squeezed))
            if len(squeezed) < len(payload):
                marked = header[:FLAGS_AT] + bytes([_SQUEEZED]) + header[FLAGS_AT + 1 :]
                return self._inner.send(marked, squeezed)
        return self._inner.send(header, payload)

    def limits(self) -> ConduitLimits:
        """The other one's: a message that only fits compressed, may not fit the next time."""
        return self._inner.limits()

    def close(self) -> None:
        """See the port."""
        self._inner.close()

    def _trial_of(self, route: bytes) -> _Trial:
        trial = self._routes.get(route)
        if trial is None:
            trial = self._routes[route] = _Trial()
            if len(self._routes) > _MAX_ROUTES:
                self._routes.popitem(last=False)
        self._routes.move_to_end(route)
        return trial


@attrs.define
class _Trial:
    """One route: whether it gains, as far as is known."""

    gains: bool = True
    """Also while it is tried."""
    left: int = _TRIED
    """Messages until it is looked at again."""
    plain_bytes: int = 0
    squeezed_bytes: int = 0

    def wants(self) -> bool:
        """Compress the next one."""
        if self.gains:
            return True
        self.left -= 1
        if not self.left:
            self._begin(_TRIED, gains=True)
        return False

    def judge(self, plain: int, squeezed: int) -> None:
        """It has been: from so many bytes to so many."""
        self.plain_bytes += plain
        self.squeezed_bytes += squeezed
        self.left -= 1
        if not self.left:
            gains = self.plain_bytes >= _GAIN * self.squeezed_bytes
            self._begin(_LEFT_ALONE, gains=gains)

    def _begin(self, count: int, *, gains: bool) -> None:
        self.gains, self.left = gains, count
        self.plain_bytes = self.squeezed_bytes = 0


class _Unpacking:
    """Gives on what came, as it was before it was compressed."""

    def __init__(self, sink: FrameSink, most_bytes: int) -> None:
        self._sink, self._most = sink, most_bytes
        self.link = sink.link

    def frame(self, header: bytes, payload: bytes) -> None:
        if (
            len(header) == HEADER_BYTES
            and header[KIND_AT] == CONTENT
            and header[FLAGS_AT] == _SQUEEZED
        ):
            plain = self._plain(payload)
            if plain is not None:
                cleared = header[:FLAGS_AT] + b"\0" + header[FLAGS_AT + 1 :]
                self._sink.frame(cleared, plain)
                return
        # What cannot be unpacked is no frame either, and is counted as none.
        self._sink.frame(header, payload)

    def _plain(self, payload: bytes) -> bytes | None:
        try:
            size = zstandard.get_frame_parameters(payload).content_size
            if size > self._most:
                return None
            return zstandard.ZstdDecompressor().decompress(payload, max_output_size=self._most)
        except zstandard.ZstdError:
            return None
