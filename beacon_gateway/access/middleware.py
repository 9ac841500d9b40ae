"""The rules of access as pure ASGI, in front of an application.

Every request gets through here, so it is one layer and not one for each rule. Bodies are bounded
in size and in how long they may take; an answer's headers say what browsers must not do with it.
"""

from __future__ import annotations

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from beacon_gateway.access.access import Access
from beacon_gateway.access.asked import Asked, Refusal

__all__ = ["MAX_HEADER_BYTES", "AccessControl"]

MAX_HEADER_BYTES = 16 * 1024
"""Names and values together: what most servers take. A token has one or two kilobytes."""

_BODY_WITHIN_S = 10.0
"""How long the next piece of a body may take."""

_ALWAYS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
)

_POLICY = (
    b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    b"connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Nothing from elsewhere, nothing inline, and in nobody's frame."""

_HTML = (
    (b"content-security-policy", _POLICY),
    (b"x-frame-options", b"DENY"),
    (b"cross-origin-opener-policy", b"same-origin"),
)

_BODYLESS = frozenset({"GET", "HEAD", "OPTIONS"})


class AccessControl:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        headers: list[tuple[bytes, bytes]] = [*_ALWAYS]
        rules, asked = self._access.rules, Asked.of(scope)
        refusal = _too_much_said(scope) or rules.check(asked, headers)
        if refusal is not None:
            await refusal.send(send, headers)
            return
        answer = _Answer(send, headers)
        if asked.method in _BODYLESS and b"content-length" not in asked.headers:
            await self._app(scope, receive, answer.send)
            return
        body = _Body(receive, rules.max_body_bytes)
        try:
            body.expect(asked.header(b"content-length"))
            await self._app(scope, body.receive, answer.send)
        except _Refused as refused:
            if answer.begun:
                raise
            await refused.refusal.send(send, [*headers, (b"connection", b"close")])


class _Refused(Exception):  # noqa: N818 - an answer, not a fault
    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.message)
        self.refusal = refusal


class _Answer:
    """Adds headers to an answer on its way out."""

    def __init__(self, send: Send, headers: list[tuple[bytes, bytes]]) -> None:
        self._send, self._headers = send, headers
        self.begun = False

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.begun = True
            given = dict(message["headers"])
            if given.get(b"content-type", b"").startswith(b"text/html"):
                self._headers += _HTML
            more = [(name, value) for name, value in self._headers if name not in given]
            message = {**message, "headers": [*message["headers"], *more]}
        await self._send(message)


class _Body:
    """A body that may not be too large, nor take too long."""

    def __init__(self, receive: Receive, at_most: int) -> None:
        self._receive, self._left, self._at_most = receive, at_most, at_most
        self._whole = False

    def expect(self, content_length: str) -> None:
        """Refuse at once what says that it is too large."""
        if content_length.isdigit() and int(content_length) > self._at_most:
            raise self._too_large()

    async def receive(self) -> Message:
        if self._whole:
            return await self._receive()
        try:
            message = await asyncio.wait_for(self._receive(), _BODY_WITHIN_S)
        except TimeoutError as error:
            raise _Refused(
                Refusal(408, "invalid-request", "Request body did not arrive in time")
            ) from error
        self._left -= len(message.get("body", b""))
        if self._left < 0:
            raise self._too_large()
        self._whole = not message.get("more_body", False)
        return message

    def _too_large(self) -> _Refused:
        limit = {"max_bytes": self._at_most}
        return _Refused(Refusal(413, "invalid-request", "Request body too large", limit))


def _too_much_said(scope: Scope) -> Refusal | None:
    size = sum(len(name) + len(value) for name, value in scope["headers"])
    if size + len(scope.get("query_string", b"")) + len(scope["path"]) <= MAX_HEADER_BYTES:
        return None
    limit = {"max_bytes": MAX_HEADER_BYTES}
    return Refusal(431, "invalid-request", "Request header fields too large", limit)
