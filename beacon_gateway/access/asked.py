"""A request as far as access is concerned, and how one is refused."""

from __future__ import annotations

import ipaddress
import json
from collections.abc import Mapping, MutableSequence, Sequence
from functools import lru_cache

import attrs
from starlette.types import Scope, Send

__all__ = ["Asked", "Headers", "Refusal", "network_of"]

Headers = MutableSequence[tuple[bytes, bytes]]
"""Headers of an answer, in order."""


@attrs.frozen
class Asked:
    """One request."""

    method: str
    path: str
    """Without what the application is mounted at."""
    headers: Mapping[bytes, bytes]
    """Of several with one name the last."""
    network: str
    """Where it comes from."""

    @classmethod
    def of(cls, scope: Scope) -> Asked:
        """``scope`` of ASGI, type ``http``."""
        path: str = scope["path"].removeprefix(scope.get("root_path", "")) or "/"
        client = scope.get("client")
        network = network_of(client[0]) if client else ""
        return cls(scope["method"], path, dict(scope["headers"]), network)

    def header(self, name: bytes) -> str:
        """``name`` in small letters; empty if it is not given."""
        return self.headers.get(name, b"").decode("latin-1")


@attrs.frozen
class Refusal:
    """An answer instead of the one asked for, in the form of all errors."""

    status: int
    code: str = ""
    message: str = ""
    parameters: Mapping[str, object] = attrs.field(factory=dict)
    headers: Sequence[tuple[bytes, bytes]] = ()

    async def send(self, send: Send, more: Sequence[tuple[bytes, bytes]]) -> None:
        """``more``: the headers that every answer has."""
        content = self._content()
        kind = [(b"content-type", b"application/json")] if content else []
        length = (b"content-length", b"%d" % len(content))
        headers = [*kind, length, *self.headers, *more]
        await send({"type": "http.response.start", "status": self.status, "headers": headers})
        await send({"type": "http.response.body", "body": content})

    def _content(self) -> bytes:
        if not self.code:
            return b""
        body: dict[str, object] = {"error_code": self.code, "message": self.message}
        return json.dumps(
            {**body, "parameters": dict(self.parameters)} if self.parameters else body
        ).encode()


@lru_cache(1024)
def network_of(host: str) -> str:
    """Whom a limit is for: one address; of IPv6 a /64, since every machine has that many."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host
    if isinstance(address, ipaddress.IPv4Address):
        return host
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(ipaddress.ip_network((address, 64), strict=False))
