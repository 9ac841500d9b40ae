"""Authentication and authorisation: whose request it is, and whether that one may send it.

A token comes as ``Authorization: Bearer``; as the password of ``Basic`` too, for tools that know
nothing else, and for reading only: a browser sends it also with what other sites make it post.

The page is open to everybody. It is the same files for all, and shows nothing until whoever looks
at it has given it a token.
"""

from __future__ import annotations

import base64
import binascii

import attrs

from beacon_gateway.access.api_tokens import ApiTokens, Identity
from beacon_gateway.access.asked import Asked, Refusal
from beacon_gateway.access.jwt_tokens import JwtTokens
from beacon_gateway.access.options import AuthConfig
from beacon_gateway.access.roles import Level, may

__all__ = ["AUTH_PATH", "OPEN_PATHS", "Auth", "covers_everything"]

AUTH_PATH = "/api/v1/auth/"
"""Where tokens are got: open to everybody."""

OPEN_PATHS = frozenset({"/livez", "/readyz", "/api/v1/livez", "/api/v1/readyz"})
"""For supervisors, which have no token; they say no more than yes or why not."""

_PAGE = "/"
_PAGE_FILES = "/page/"
_REALM = b'realm="beacon"'
_READS = frozenset({"GET", "HEAD"})


@attrs.frozen
class Auth:
    """Thread rule: it never changes; any thread."""

    config: AuthConfig
    api_tokens: ApiTokens
    jwt_tokens: JwtTokens

    def check(self, asked: Asked) -> Refusal | None:
        """Refuses whoever is unknown, or may not."""
        if not self.config.require_auth_for.covers(asked.method) or _is_open(asked.path):
            return None
        owner = self._owner(asked)
        if owner is None:
            return _unknown(asked)
        if may(owner.role, asked.method, asked.path):
            return None
        return Refusal(
            403,
            "forbidden",
            "Insufficient permissions",
            {"role": owner.role.value, "method": asked.method, "path": asked.path},
        )

    def owner(self, token: str) -> Identity | None:
        """Whose token it is."""
        return self.api_tokens.owner(token) or self.jwt_tokens.owner(token)

    def _owner(self, asked: Asked) -> Identity | None:
        scheme, _, credentials = asked.header(b"authorization").partition(" ")
        credentials = credentials.strip()
        if scheme.lower() == "bearer" and credentials:
            return self.owner(credentials)
        if scheme.lower() == "basic" and asked.method in _READS:
            password = _password(credentials)
            return self.owner(password) if password else None
        return None


def _is_open(path: str) -> bool:
    return path in OPEN_PATHS or path == _PAGE or path.startswith((AUTH_PATH, _PAGE_FILES))


def _unknown(asked: Asked) -> Refusal:
    # Not Basic: a browser would ask its user, in a window of its own, for what the page fetches.
    challenge = b"Bearer " + _REALM + b', error="invalid_token"'
    message = "Invalid or expired token" if asked.header(b"authorization") else "Token required"
    return Refusal(401, "unauthorized", message, {}, [(b"www-authenticate", challenge)])


def _password(credentials: str) -> str:
    try:
        decoded = base64.b64decode(credentials, validate=True).decode()
    except (binascii.Error, UnicodeDecodeError):
        return ""
    return decoded.partition(":")[2]


def covers_everything(config: AuthConfig | None) -> bool:
    """Is nothing told to strangers?"""
    return config is not None and config.require_auth_for is Level.ALL
