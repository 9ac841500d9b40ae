"""CORS as ros2_medkit answers it: which pages from elsewhere may read the answers.

Nothing at all unless an origin is allowed. Then an allowed origin is echoed, also where ``*``
allows it; a preflight is answered here, with 204, or with 403 and no CORS header.
"""

from __future__ import annotations

from beacon_gateway.access.asked import Asked, Headers, Refusal
from beacon_gateway.access.options import CorsConfig

__all__ = ["Cors"]

_EXPOSED = (
    b"Content-Disposition, Content-Length, X-RateLimit-Limit, X-RateLimit-Remaining, "
    b"X-RateLimit-Reset, Retry-After"
)


class Cors:
    """Thread rule: it keeps nothing; any thread."""

    def __init__(self, config: CorsConfig) -> None:
        self._origins = frozenset(config.allowed_origins)
        self._max_age = b"%d" % config.max_age_s
        self._granted = [
            (b"access-control-allow-methods", ", ".join(config.allowed_methods).encode()),
            (b"access-control-allow-headers", ", ".join(config.allowed_headers).encode()),
            (b"access-control-expose-headers", _EXPOSED),
        ]
        if config.allow_credentials:
            self._granted.append((b"access-control-allow-credentials", b"true"))

    def check(self, asked: Asked, headers: Headers) -> Refusal | None:
        """Adds to the answer's headers; answers a preflight."""
        if not self._origins:
            return None
        # One address has several answers: whoever keeps them must keep them apart.
        headers.append((b"vary", b"Origin"))
        origin = asked.header(b"origin")
        allowed = bool(origin) and ("*" in self._origins or origin in self._origins)
        if allowed:
            headers.append((b"access-control-allow-origin", origin.encode("latin-1")))
            headers.extend(self._granted)
        if asked.method != "OPTIONS":
            return None
        if allowed:
            headers.append((b"access-control-max-age", self._max_age))
        return Refusal(204 if allowed else 403)
