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
_SAY_BODY = frozenset({b"content-length", b"transfer-encoding"})

_TOO_MUCH_SAID = Refusal(
    431, "invalid-request", "Request header fields too large", {"max_bytes": MAX_HEADER_BYTES}
)


class AccessControl:
    """ASGI middleware."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        rules = self._access.rules
        headers: list[tuple[bytes, bytes]] = [*_ALWAYS]
        size, has_body = _head(scope)
        refusal = _TOO_MUCH_SAID if size > MAX_HEADER_BYTES else None
        if refusal is None and not rules.let_everything_pass:
            refusal = rules.check(Asked.of(scope), headers)
        if refusal is not None:
            await refusal.send(send, headers)
            return
        answer = _Answer(send, headers)
        if has_body:
            await self._with_body(scope, _Body(receive, rules.max_body_bytes), answer)
        else:
            await self._app(scope, receive, answer.send)

    async def _with_body(self, scope: Scope, body: _Body, answer: _Answer) -> None:
        try:
            body.expect(dict(scope["headers"]).get(b"content-length", b""))
            await self._app(scope, body.receive, answer.send)
        except _Refused as refused:
            if answer.begun:
                raise
            await answer.refuse(refused.refusal)


class _Refused(Exception):  # noqa: N818 - an answer, not a fault
    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.message)
        self.refusal = refusal


class _Answer:
    """Adds headers to an answer on its way out."""

    __slots__ = ("_headers", "_send", "begun")

    def __init__(self, send: Send, headers: list[tuple[bytes, bytes]]) -> None:
        self._send, self._headers = send, headers
        self.begun = False

    async def send(self, message: Message) -> None:
        if not self.begun:
            self.begun = True
            given = dict(message["headers"])
            if given.get(b"content-type", b"").startswith(b"text/html"):
                self._headers += _HTML
            # What a route says for itself stands.
            more = [one for one in self._headers if one[0] not in given]
            message["headers"] = [*message["headers"], *more]
        await self._send(message)

    async def refuse(self, refusal: Refusal) -> None:
        await refusal.send(self._send, [*self._headers, (b"connection", b"close")])


class _Body:
    """A body that may not be too large, nor take too long."""

    def __init__(self, receive: Receive, at_most: int) -> None:
        self._receive, self._left, self._at_most = receive, at_most, at_most
        self._whole = False

    def expect(self, content_length: bytes) -> None:
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


def _head(scope: Scope) -> tuple[int, bool]:
    """How many bytes the head has, and whether it announces a body."""
    size, has_body = len(scope["path"]) + len(scope.get("query_string", b"")), False
    # One plain loop: this runs for every request.
    for name, value in scope["headers"]:
        size += len(name) + len(value)
        if name in _SAY_BODY:
            has_body = True
    return size, has_body or scope["method"] not in _BODYLESS
