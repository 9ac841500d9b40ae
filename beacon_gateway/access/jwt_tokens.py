"""Bearer tokens as JWT (RFC 7519): made for configured clients, or by somebody whose key we know.

Two kinds, told apart by ``typ`` in the header: an access token opens routes, a refresh token only
gets new access tokens. An access token names its refresh token, so revoking that one ends both.
"""

from __future__ import annotations

import threading
import time
import uuid
from pathlib import Path
from typing import Any

import attrs
import jwt

from beacon_core.errors import ConfigError
from beacon_gateway.access.api_tokens import Identity
from beacon_gateway.access.options import AuthConfig
from beacon_gateway.access.roles import Role

__all__ = ["JwtTokens", "Keys", "Revoked", "TokenPair"]

_MIN_SECRET_BYTES = 32
"""RFC 7518: as long as the hash."""

_REFRESH, _ACCESS = "refresh", "access"
_REQUIRED = ["exp", "iat", "iss", "sub", "jti", "role"]


@attrs.frozen
class Keys:
    """What tokens are signed and checked with."""

    checks: Any = attrs.field(repr=False)
    """``None``: there are no such tokens."""
    signs: Any = attrs.field(default=None, repr=False)
    """``None``: they are made elsewhere."""

    @classmethod
    def of(cls, config: AuthConfig) -> Keys:
        """Raises ``ConfigError`` for a file that holds none, or too short a one."""
        if config.algorithm == "RS256":
            private, public = _key(config.private_key), _key(config.public_key)
            if private is not None and public is None:
                public = private.public_key()
            return cls(public, private)
        if config.secret_file is None:
            return cls(None)
        secret = _read(config.secret_file).strip()
        if len(secret) < _MIN_SECRET_BYTES:
            raise ConfigError(
                f"{config.secret_file}: a secret of {len(secret)} bytes is too short; "
                f"give at least {_MIN_SECRET_BYTES}, such as from 'openssl rand -hex 32'"
            )
        return cls(secret, secret)


@attrs.frozen
class TokenPair:
    """What a client gets."""

    access: str = attrs.field(repr=False)
    refresh: str = attrs.field(repr=False)
    role: Role
    expires_in_s: int


class Revoked:
    """The tokens that count no more, each until it would have expired anyway.

    Kept in memory only: after a restart a revoked token counts again until it expires. A new key
    ends them all for good.

    Thread rule: every method may be called from any thread.
    """

    def __init__(self, at_most: int = 10_000) -> None:
        """Beyond ``at_most`` the one that expires first is forgotten first."""
        self._at_most = at_most
        self._expiry_s: dict[str, float] = {}
        self._lock = threading.Lock()

    def add(self, token_id: str, expiry_s: float) -> None:
        """``expiry_s`` in seconds since 1970."""
        with self._lock:
            self._expiry_s[token_id] = expiry_s
            if len(self._expiry_s) > self._at_most:
                first = min(self._expiry_s, key=self._expiry_s.__getitem__)
                del self._expiry_s[first]

    def __contains__(self, token_id: object) -> bool:
        return token_id in self._expiry_s


class JwtTokens:
    """Thread rule: every method may be called from any thread."""

    def __init__(self, config: AuthConfig, keys: Keys, revoked: Revoked) -> None:
        self._config, self._keys, self._revoked = config, keys, revoked
        self.makes = keys.signs is not None

    def pair(self, owner: Identity) -> TokenPair:
        """New tokens."""
        refresh_id = str(uuid.uuid4())
        config = self._config
        refresh = self._signed(_REFRESH, owner, refresh_id, config.refresh_token_expiry_s)
        access = self._access(owner, refresh_id)
        return TokenPair(access, refresh, owner.role, config.token_expiry_s)

    def refreshed(self, refresh: str) -> TokenPair | None:
        """A new access token for a refresh token that still counts."""
        claims = self._claims(refresh, {_REFRESH})
        if claims is None:
            return None
        owner = Identity(str(claims["sub"]), Role(claims["role"]))
        access = self._access(owner, claims["jti"])
        return TokenPair(access, refresh, owner.role, self._config.token_expiry_s)

    def owner(self, access: str) -> Identity | None:
        """Whose access token it is, if it counts."""
        claims = self._claims(access, None)
        return None if claims is None else Identity(str(claims["sub"]), Role(claims["role"]))

    def revoke(self, token: str) -> None:
        """From now on it does not count, if it ever did."""
        claims = self._claims(token, {_ACCESS, _REFRESH})
        if claims is not None:
            self._revoked.add(claims["jti"], float(claims["exp"]))

    def _access(self, owner: Identity, refresh_id: str) -> str:
        expiry_s = self._config.token_expiry_s
        return self._signed(_ACCESS, owner, str(uuid.uuid4()), expiry_s, refresh_id)

    def _signed(
        self, kind: str, owner: Identity, token_id: str, expiry_s: int, refresh_id: str = ""
    ) -> str:
        now_s = int(time.time())
        claims: dict[str, Any] = {
            "iss": self._config.issuer,
            "sub": owner.name,
            "iat": now_s,
            "exp": now_s + expiry_s,
            "jti": token_id,
            "role": owner.role.value,
        }
        if refresh_id:
            claims["refresh_token_id"] = refresh_id
        algorithm = self._config.algorithm
        return jwt.encode(claims, self._keys.signs, algorithm, headers={"typ": kind})

    def _claims(self, token: str, kinds: set[str] | None) -> dict[str, Any] | None:
        """``None`` unless it counts; ``kinds``: of these only, else of all but refresh tokens."""
        if self._keys.checks is None:
            return None
        try:
            whole = jwt.decode_complete(
                token,
                self._keys.checks,
                algorithms=[self._config.algorithm],
                issuer=self._config.issuer,
                options={"require": _REQUIRED, "verify_aud": False},
            )
        except jwt.InvalidTokenError:
            return None
        kind, claims = whole["header"].get("typ"), whole["payload"]
        if kind == _REFRESH if kinds is None else kind not in kinds:
            return None
        if claims["role"] not in list(Role) or self._is_revoked(claims):
            return None
        return dict(claims)

    def _is_revoked(self, claims: dict[str, Any]) -> bool:
        named = (claims["jti"], claims.get("refresh_token_id"))
        return any(str(token_id) in self._revoked for token_id in named)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from error


def _key(path: Path | None) -> Any:
    if path is None:
        return None
    try:
        return jwt.get_algorithm_by_name("RS256").prepare_key(_read(path))
    except (ValueError, TypeError, jwt.InvalidKeyError) as error:
        raise ConfigError(f"{path}: no RSA key in PEM form") from error
