"""All that is checked before a request reaches its route, and how it changes while serving.

In ros2_medkit's order: CORS, preflights, rate limits, authentication. What is in force is one
immutable value; a reload makes another one whole and then puts it in its place, so no request is
checked by half of each.
"""

from __future__ import annotations

import attrs

from beacon_core.errors import ConfigError
from beacon_gateway.access.api_tokens import ApiTokens
from beacon_gateway.access.asked import Asked, Headers, Refusal
from beacon_gateway.access.auth import AUTH_PATH, OPEN_PATHS, Auth
from beacon_gateway.access.cors import Cors
from beacon_gateway.access.jwt_tokens import JwtTokens, Keys, Revoked
from beacon_gateway.access.options import AuthConfig
from beacon_gateway.access.rate_limit import RateLimiter
from beacon_gateway.config import HttpConfig

__all__ = ["Access", "Rules"]

_AUTH_RPM = {f"{AUTH_PATH}*": 60}
"""Requests for tokens from one address: guessing secrets is hopeless, and so is keeping the slow
hash busy."""


@attrs.frozen
class Rules:
    """What is in force.

    Thread rule: it never changes; any thread.
    """

    cors: Cors
    limiter: RateLimiter
    auth: Auth | None
    max_body_bytes: int
    let_everything_pass: bool
    """Nothing is configured, as by default: there is nothing to check."""

    def check(self, asked: Asked, headers: Headers) -> Refusal | None:
        """Adds to the answer's headers; ``None``: let it pass."""
        refusal = self.cors.check(asked, headers)
        if refusal is None and asked.path not in OPEN_PATHS:
            refusal = self.limiter.check(asked, headers)
            if refusal is None and self.auth is not None:
                refusal = self.auth.check(asked)
        return refusal


class Access:
    """Thread rule: ``rules`` may be read from any thread; the rest from one at a time."""

    def __init__(self, config: HttpConfig) -> None:
        """Reads tokens and keys. Raises ``ConfigError`` for what is wrong with them."""
        self._revoked = Revoked()
        self._config = config
        self.rules = self._made(config, _limiter(config))

    def prepared(self, config: HttpConfig) -> Rules:
        """The rules of another configuration, with tokens and keys as they are in their files now.

        Raises ``ConfigError``, and nothing has changed. What was revoked stays so; who is near a
        limit stays near it, unless the limits have changed.
        """
        same = _limits(config) == _limits(self._config)
        return self._made(config, self.rules.limiter if same else _limiter(config))

    def put(self, rules: Rules, config: HttpConfig) -> None:
        """Let what was :meth:`prepared` for this configuration be in force."""
        self.rules, self._config = rules, config

    def _made(self, config: HttpConfig, limiter: RateLimiter) -> Rules:
        auth = None if config.auth is None else self._auth(config.auth)
        return Rules(
            Cors(config.cors),
            limiter,
            auth,
            config.max_body_bytes,
            let_everything_pass=not (
                auth or config.cors.allowed_origins or config.rate_limit.enabled
            ),
        )

    def _auth(self, config: AuthConfig) -> Auth:
        try:
            path = config.tokens_file
            tokens = ApiTokens() if path is None else ApiTokens.read(path)
            return Auth(config, tokens, JwtTokens(config, Keys.of(config), self._revoked))
        except ConfigError as error:
            raise ConfigError(f"$.http.auth: {error}") from error


def _limits(config: HttpConfig) -> tuple[object, bool]:
    """What the limiter depends on."""
    return config.rate_limit, config.auth is not None


def _limiter(config: HttpConfig) -> RateLimiter:
    return RateLimiter(config.rate_limit, always=None if config.auth is None else _AUTH_RPM)
