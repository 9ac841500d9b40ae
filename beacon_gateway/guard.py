"""What uvicorn leaves open: a client that never ends the head of its request.

uvicorn waits for it for ever, and with httptools takes whatever comes. Here a head must be there
within ``HEAD_WITHIN_S`` of the connection or of its first byte, and may have ``MAX_HEAD_BYTES``.
So half-open connections and those that send a byte now and then go away by themselves.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import h11
from uvicorn.protocols.http.auto import AutoHTTPProtocol

__all__ = ["HEAD_WITHIN_S", "MAX_HEAD_BYTES", "GuardedProtocol"]

HEAD_WITHIN_S = 10.0
"""Apache waits 20 s for the first byte, nginx 60 s for a whole head; robots are near."""

MAX_HEAD_BYTES = 64 * 1024
"""What h11 keeps of an unfinished head; the interface itself refuses far less in good order."""

if TYPE_CHECKING:
    _Base = asyncio.Protocol
else:
    _Base = object


class _Guard(_Base):
    """Goes in front of either of uvicorn's protocols; thread rule: the event loop."""

    transport: asyncio.Transport
    loop: asyncio.AbstractEventLoop

    _deadline: asyncio.TimerHandle | None = None
    _in_head = False
    _head_bytes = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._await_head()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if not self._head_is_open():
            self._head_arrived()
            return
        self._head_bytes += len(data)
        if self._head_bytes > MAX_HEAD_BYTES:
            self._refuse(b"431 Request Header Fields Too Large")
        elif self._deadline is None:
            self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        self._head_arrived()
        super().connection_lost(exc)

    def on_message_begin(self) -> None:
        """Called by httptools."""
        self._in_head = True
        _super(self, "on_message_begin")()

    def on_headers_complete(self) -> None:
        """Called by httptools."""
        self._in_head = False
        _super(self, "on_headers_complete")()

    def _head_is_open(self) -> bool:
        if self.transport.is_closing():
            return False
        conn: h11.Connection | None = getattr(self, "conn", None)
        return self._in_head if conn is None else conn.their_state is h11.IDLE

    def _await_head(self) -> None:
        self._deadline = self.loop.call_later(HEAD_WITHIN_S, self._refuse, b"408 Request Timeout")

    def _head_arrived(self) -> None:
        self._head_bytes = 0
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _refuse(self, status: bytes) -> None:
        self._head_arrived()
        if not self.transport.is_closing():
            head = b"HTTP/1.1 %b\r\ncontent-length: 0\r\nconnection: close\r\n\r\n" % status
            self.transport.write(head)
            self.transport.close()


def _super(guard: _Guard, name: str) -> Any:
    return getattr(super(_Guard, guard), name)


GuardedProtocol: type[asyncio.Protocol] = type("GuardedProtocol", (_Guard, AutoHTTPProtocol), {})
"""uvicorn's protocol, httptools or h11, whichever is installed, with the guard."""
