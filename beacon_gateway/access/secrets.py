"""Secrets, and what may be kept of them: a hash from which nobody gets them back.

An API token is 256 random bits, so nobody guesses it and one round of SHA-256 is enough; it is
checked at each request. A client's secret may have been thought up by somebody, so its hash is made
slow on purpose (scrypt, 16 MiB and some tens of milliseconds); it is checked once per session.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets

__all__ = [
    "NOBODYS_HASH",
    "hash_secret",
    "hash_token",
    "is_secret_hash",
    "is_token_hash",
    "new_token",
    "secret_matches",
]

_N, _R, _P = 2**14, 8, 1
"""OWASP's second-smallest setting for scrypt: what a robot's computer can afford."""

_SECRET = re.compile(r"scrypt:([A-Za-z0-9_-]{22}):([A-Za-z0-9_-]{43})")
_TOKEN = re.compile(r"sha256:[0-9a-f]{64}")

_MAX_SECRET_BYTES = 1024


def new_token() -> str:
    """A new API token or secret."""
    return "bcn_" + secrets.token_urlsafe(32)


def hash_token(token: str) -> str:
    """What a tokens file keeps of a token."""
    return "sha256:" + hashlib.sha256(token.encode("utf-8", errors="replace")).hexdigest()


def is_token_hash(text: str) -> bool:
    """Could :func:`hash_token` have made it?"""
    return _TOKEN.fullmatch(text) is not None


def hash_secret(secret: str) -> str:
    """What the configuration keeps of a client's secret; another one each time."""
    salt = secrets.token_bytes(16)
    return f"scrypt:{_text(salt)}:{_text(_slow(secret, salt))}"


def is_secret_hash(text: str) -> bool:
    """Could :func:`hash_secret` have made it?"""
    return _SECRET.fullmatch(text) is not None


def secret_matches(secret: str, hashed: str) -> bool:
    """Takes as long whether it does or not; some tens of milliseconds."""
    found = _SECRET.fullmatch(hashed)
    if found is None or len(secret.encode("utf-8", errors="replace")) > _MAX_SECRET_BYTES:
        return False
    salt, expected = (base64.urlsafe_b64decode(part + "==") for part in found.groups())
    return hmac.compare_digest(_slow(secret, salt), expected)


def _slow(secret: str, salt: bytes) -> bytes:
    words = secret.encode("utf-8", errors="replace")
    return hashlib.scrypt(words, salt=salt, n=_N, r=_R, p=_P, dklen=32)


def _text(raw: bytes) -> str:
    return base64.urlsafe_b64encode(raw).rstrip(b"=").decode()


NOBODYS_HASH = f"scrypt:{_text(bytes(16))}:{_text(bytes(32))}"
"""Checked for an unknown client, so that its answer takes as long as that for a wrong secret."""
