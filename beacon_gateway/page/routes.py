"""The page and its files, as they are in the package.

What it shows comes from robots, so it is hostile text. Two things keep it text: the scripts only
ever set ``textContent``, and the policy below lets no browser run, load or send anything else.
"""

from __future__ import annotations

import hashlib
from importlib.resources import files

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from beacon_gateway.gateway import Gateway

__all__ = ["HEADERS", "routes"]

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; require-trusted-types-for 'script'; trusted-types 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    # The page of another version would not match its scripts.
    "cache-control": "no-cache",
}
"""Of each of its files: nothing from elsewhere, nothing inline, and no text ever becomes a page."""

_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


def routes(_: Gateway) -> list[BaseRoute]:
    """The page at ``/`` and its files beside it."""
    found = {
        path.name: path.read_bytes()
        for path in files("beacon_gateway.page").joinpath("static").iterdir()
    }
    return [
        Route("/" if name == "index.html" else f"/page/{name}", _File(name, content).serve)
        for name, content in sorted(found.items())
    ]


class _File:
    def __init__(self, name: str, content: bytes) -> None:
        self._content = content
        self._etag = f'"{hashlib.sha256(content).hexdigest()[:16]}"'
        self._headers = {
            **HEADERS,
            "etag": self._etag,
            "content-type": _TYPES[name[name.rindex(".") :]],
        }

    async def serve(self, request: Request) -> Response:
        """The file, or that it is as the browser has it."""
        if request.headers.get("if-none-match") == self._etag:
            return Response(status_code=304, headers=self._headers)
        return Response(self._content, headers=self._headers)
