"""The short way for answers that are kept: past the routes, straight to whoever asks.

Finding the route and making Starlette's request and response costs more than the rest of such an
answer. So this stands before the routes, and behind the rules of access.
"""

from __future__ import annotations

from starlette.types import ASGIApp, Receive, Scope, Send

from beacon_gateway.http.snapshots import Snapshots
from beacon_gateway.writing import JSON

__all__ = ["Shortcut", "key_of"]

_KIND = (b"content-type", JSON.encode())


class Shortcut:
    """ASGI middleware: gives what is kept, and passes all else on."""

    def __init__(self, app: ASGIApp, kept: Snapshots) -> None:
        self._app, self._kept = app, kept

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        content = None
        if scope["type"] == "http" and scope["method"] == "GET":
            content = self._kept.get(key_of(scope))
        if content is None:
            await self._app(scope, receive, send)
            return
        headers = [(b"content-length", b"%d" % len(content)), _KIND]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": content})


def key_of(scope: Scope) -> tuple[str, str]:
    """What makes a difference to an answer that is kept: whom it is about, and its addresses."""
    return scope.get("root_path", ""), scope["path"]
