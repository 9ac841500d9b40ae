"""What uvicorn leaves open: a client that never ends the head of its request.

uvicorn waits for it for ever, and takes whatever comes. Here a head must be there within
``HEAD_WITHIN_S`` of the connection or of its first byte, and may have ``MAX_HEAD_BYTES``. So
half-open connections and those that send a byte now and then go away by themselves.
"""

from __future__ import annotations

import asyncio

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

__all__ = ["HEAD_WITHIN_S", "MAX_HEAD_BYTES", "GuardedProtocol"]

HEAD_WITHIN_S = 10.0
"""Apache waits 20 s for the first byte, nginx 60 s for a whole head; robots are near."""

MAX_HEAD_BYTES = 64 * 1024
"""Before it is read as one; the interface itself refuses far less in good order."""


class GuardedProtocol(HttpToolsProtocol):
    """uvicorn's protocol with limits for a head; thread rule: the event loop."""

    _deadline: asyncio.TimerHandle | None = None
    _in_head = True
    _head_bytes = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._await_head()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if not self._in_head or self.transport.is_closing():
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
        self._in_head = True
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        self._in_head = False
        super().on_headers_complete()

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
