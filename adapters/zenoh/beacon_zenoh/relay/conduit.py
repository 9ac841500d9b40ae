"""A relay's conduit over Zenoh.

=======================================  ===================================================
``<prefix>/relay/<link>/ask``            resets: what republishers ask
``<prefix>/relay/<link>/tell/<size>``    all other frames; ``small`` or ``large``
``<prefix>/relay/<link>/end/<id>``       a liveliness token that lives as long as an end
=======================================  ===================================================

A frame's header is the message's attachment, its payload the message's payload.

Theory. Zenoh is told to drop what it cannot send: to block would hold up all others behind the same
router, and end the connection after 5 s. It drops after ``_WAIT_MS`` for each 64 KiB. A small frame
is put by whoever sends it, which is the fastest; a large one, or any after one that had to wait, is
left in the :mod:`.outbox`. What has been dropped is noticed and asked for by the relay, which knows
what is missing, and keeps it in bytes that it counts: so Zenoh's own caches and sequence numbers
(advanced publishers) are not needed.

Frames that tell all travel in one queue, in order: a digest that overtook the contents before it
would make the other side ask for what is under way already. Resets have a queue of their own.

An end that has told, and never asked, is a forwarder's alone: it is not sent what others tell, so
that robots on one link are not sent each other's pictures.
"""

from __future__ import annotations

import atexit
import logging
import secrets
import threading
import time
import weakref
from functools import partial
from threading import get_ident
from typing import Any

import zenoh
from zenoh.handlers import Callback

from beacon_core.errors import UsageError
from beacon_core.ports.conduit import ConduitLimits, FrameSink
from beacon_core.relay.frames import KIND_AT, Kind
from beacon_zenoh.config import session_config
from beacon_zenoh.relay.options import MAX_HEADER_BYTES, RelayOptions
from beacon_zenoh.relay.outbox import Outbox
from beacon_zenoh.session import CLOSE_WITHIN_S, SessionKeeper

__all__ = ["DEFAULTS", "LEASE_S", "LONGEST_WAIT_S", "ZenohConduit"]

_log = logging.getLogger(__name__)

LEASE_S = 1.5
"""The port promises that a link that breaks is told within 2 s."""

LONGEST_WAIT_S = 3.0
"""Of one frame, in the outbox's thread. While it waits, Zenoh cannot end its connection, and no
other session of the process begins one: an end that hangs is told so much later. With less, a large
frame would never pass a slow link: 1 MiB needs 3 Mbit/s."""

_WAIT_MS = 80
"""Two of them, which a frame of ``_DIRECT_BYTES`` may need, are below the 250 ms of the port."""

_DIRECT_BYTES = 96 * 1024
"""Larger frames go through the outbox."""

_SMALL_BYTES = 32 * 1024
"""The binding's queue before a callback holds 256 messages: 8 MiB of these at the most."""

_SLOW_S = _WAIT_MS / 2000
"""A frame that took so long had to wait for the carrier. Not less: on a busy machine any frame may
take some ms, and to go through the outbox costs a small one five times as much."""

DEFAULTS = {
    "transport": {
        "link": {
            "tx": {
                "lease": round(LEASE_S * 1e3),
                "queue": {
                    "congestion_control": {
                        "drop": {
                            "wait_before_drop": _WAIT_MS * 1000,
                            "max_wait_before_drop_fragments": round(LONGEST_WAIT_S * 1e6),
                        }
                    }
                },
            }
        }
    }
}
"""What a relay's session is told other than those of hints."""

_PUT = zenoh.SampleKind.PUT
_REMOTE = zenoh.Locality.REMOTE
_RESET = int(Kind.RESET)
_TELLING = frozenset(map(int, (Kind.ADVERTISEMENT, Kind.CONTENT, Kind.DIGEST)))


class ZenohConduit:
    """Implements :class:`beacon_core.ports.conduit.Conduit`; the thread rule is the port's."""

    def __init__(self, options: RelayOptions) -> None:
        """Opens nothing. ``ConfigError`` for what Zenoh refuses."""
        config = session_config(options, "router" if options.listen else "client", DEFAULTS)
        self._keeper = SessionKeeper(
            config, declare=self._declare, step=self._step, farewell=lambda _: None
        )
        self._base = f"{options.prefix}/relay/{options.link}"
        self._id = secrets.token_hex(8)
        self._most = options.send_bytes - MAX_HEADER_BYTES
        self._outbox = Outbox(options.send_bytes, self._put_swiftly)
        self._sink: FrameSink | None = None
        self._others: set[str] = set()
        self._up = self._told = self._asked = self._closed = False
        self._ask: zenoh.Publisher | None = None
        self._tell: tuple[zenoh.Publisher, zenoh.Publisher] | None = None
        self._hearing: list[zenoh.Subscriber[Any]] = []
        self._token: zenoh.LivelinessToken | None = None
        # Held during each call of the sink: what makes "after close, no call" true.
        self._gate = threading.Lock()
        self._speaker = 0  # the thread that is in such a call

    def start(self, sink: FrameSink) -> None:
        """``ConfigError`` if it cannot listen; ``UsageError`` for a second start."""
        if self._sink is not None:
            raise UsageError("start: it was started already; make a new one")
        self._sink = sink
        _open_conduits.add(self)
        self._keeper.start()

    def send(self, header: bytes, payload: bytes) -> bool:
        if not self._up or len(header) > MAX_HEADER_BYTES or len(payload) > self._most:
            return False
        kind = header[KIND_AT] if len(header) > KIND_AT else 0
        if not self._told and kind in _TELLING:
            self._told = True
            self._keeper.wake()
        if kind == _RESET:
            return self._send_reset(header, payload)
        outbox = self._outbox
        if outbox.busy or len(header) + len(payload) > _DIRECT_BYTES:
            return outbox.offer(header, payload)
        began = time.monotonic()
        sent = self._put(header, payload)
        if time.monotonic() - began > _SLOW_S:
            outbox.busy = True
        return sent

    def limits(self) -> ConduitLimits:
        return ConduitLimits(MAX_HEADER_BYTES, self._most)

    def close(self) -> None:
        if self._keeper.forked:
            return
        deadline = time.monotonic() + CLOSE_WITHIN_S
        inside = self._speaker == get_ident()
        # A sink that hangs must not hang us: it finds the gate shut when it is through.
        held = not inside and self._gate.acquire(timeout=CLOSE_WITHIN_S / 2)
        self._closed, self._up = True, False
        if held:
            self._gate.release()
        self._outbox.close(0.0 if inside else 2 * _WAIT_MS / 1000)
        self._keeper.close(0.0 if inside else max(0.0, deadline - time.monotonic()))

    # -- in the threads of those who send, and the outbox's

    def _send_reset(self, header: bytes, payload: bytes) -> bool:
        if not self._asked:
            self._asked = True
            self._keeper.wake()
        ask = self._ask
        return ask is not None and _put(ask, header, payload)

    def _put(self, header: bytes, payload: bytes) -> bool:
        tell = self._tell
        if tell is None:
            return False
        return _put(tell[len(header) + len(payload) > _SMALL_BYTES], header, payload)

    def _put_swiftly(self, header: bytes, payload: bytes) -> bool:
        began = time.monotonic()
        self._put(header, payload)
        return time.monotonic() - began <= _SLOW_S

    # -- in the keeper's thread

    def _declare(self, session: zenoh.Session) -> None:
        others: set[str] = set()
        self._others = others
        self._news_of_the_link()
        tell = partial(
            session.declare_publisher,
            congestion_control=zenoh.CongestionControl.DROP,
            allowed_destination=_REMOTE,
        )
        self._ask = tell(
            f"{self._base}/ask", priority=zenoh.Priority.INTERACTIVE_HIGH, express=True
        )
        self._tell = (tell(f"{self._base}/tell/small"), tell(f"{self._base}/tell/large"))
        session.declare_subscriber(f"{self._base}/ask", self._on_frame, allowed_origin=_REMOTE)
        self._hearing = []
        self._hear(session)
        # With a callback: the default channel deadlocks on the 257th token. And never liveliness()
        # .get on this session: it leaves ghosts in it.
        session.liveliness().declare_subscriber(
            f"{self._base}/end/*", partial(self._on_token, others), history=True
        )
        # Last: whoever sees it may send. It lasts as long as somebody has it.
        self._token = session.liveliness().declare_token(f"{self._base}/end/{self._id}")

    def _step(self, session: zenoh.Session | None) -> None:
        if session is not None:
            self._hear(session)
        elif self._others:
            self._others = set()
            self._news_of_the_link()

    def _hear(self, session: zenoh.Session) -> None:
        """What others tell, unless we are a forwarder's end."""
        wanted = self._asked or not self._told
        if wanted and not self._hearing:
            declare = partial(session.declare_subscriber, allowed_origin=_REMOTE)
            self._hearing = [
                declare(f"{self._base}/tell/small", self._on_frame),
                # Not through the binding's queue, which would hold 256 of them.
                declare(f"{self._base}/tell/large", Callback(self._on_frame, indirect=False)),
            ]
        elif not wanted:
            while self._hearing:
                self._hearing.pop().undeclare()  # type: ignore[no-untyped-call]

    # -- in Zenoh's threads

    def _on_frame(self, sample: zenoh.Sample) -> None:
        attachment = sample.attachment
        header = b"" if attachment is None else attachment.to_bytes()
        payload = sample.payload.to_bytes()
        with self._gate:
            if self._closed or self._sink is None:
                return
            self._speaker = get_ident()
            try:
                self._sink.frame(header, payload)
            except Exception:  # noqa: BLE001
                # Sinks do not raise; one that does must not cost the frames that follow.
                _log.exception("the sink raised")
            finally:
                self._speaker = 0

    def _on_token(self, others: set[str], sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rpartition("/")[2]
        if name == self._id:
            return
        if sample.kind == _PUT:
            others.add(name)
        else:
            others.discard(name)
        self._news_of_the_link()

    def _news_of_the_link(self) -> None:
        """Tell the sink, if something has changed."""
        with self._gate:
            up = bool(self._others)
            if self._closed or self._sink is None or up == self._up:
                return
            self._up = up
            if not up:
                self._outbox.clear()
            self._speaker = get_ident()
            try:
                self._sink.link(up=up)
            except Exception:  # noqa: BLE001
                _log.exception("the sink raised")
            finally:
                self._speaker = 0


def _put(publisher: zenoh.Publisher, header: bytes, payload: bytes) -> bool:
    try:
        publisher.put(payload, attachment=header)
    except zenoh.ZError as error:  # its session was closed meanwhile
        _log.debug("a frame was not sent: %s", error)
        return False
    return True


_open_conduits: weakref.WeakSet[ZenohConduit] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """A thread that is in Zenoh while the interpreter is dismantled ends the process badly."""
    for conduit in list(_open_conduits):
        conduit.close()
