"""API tokens from a file: ``name:role:sha256:...`` per line, as ``beacon token`` prints them."""

from __future__ import annotations

import hmac
from collections.abc import Iterable
from pathlib import Path

import attrs

from beacon_core.errors import ConfigError
from beacon_gateway.access.roles import Role
from beacon_gateway.access.secrets import hash_token, is_token_hash
from beacon_gateway.problems import DocumentError, Problem

__all__ = ["ApiToken", "ApiTokens", "Identity"]

_MAX_TOKENS = 1000
"""Each is compared at each request: more than some hundreds belong into a service of their own."""


@attrs.frozen
class Identity:
    """Who asks."""

    name: str
    role: Role


@attrs.frozen
class ApiToken:
    """One line of the file."""

    owner: Identity
    hashed: bytes

    def line(self) -> str:
        """As the file has it."""
        return f"{self.owner.name}:{self.owner.role}:{self.hashed.decode()}"


class ApiTokens:
    """Thread rule: it never changes; any thread."""

    def __init__(self, tokens: Iterable[ApiToken] = ()) -> None:
        self._tokens = tuple(tokens)

    @classmethod
    def read(cls, path: Path) -> ApiTokens:
        """Raises ``ConfigError``: every line that is none."""
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path}: {getattr(error, 'strerror', '') or error}") from error
        tokens, problems = [], []
        for number, line in enumerate(lines, 1):
            text = line.partition("#")[0].strip()
            token = _parsed(text) if text else None
            if token is not None:
                tokens.append(token)
            elif text:
                problems.append(Problem(f"line {number}", _RIGHT))
        if len(tokens) > _MAX_TOKENS:
            problems.append(Problem(f"{len(tokens)} tokens", f"give at most {_MAX_TOKENS}"))
        if problems:
            raise DocumentError(attrs.evolve(one, path=f"{path}: {one.path}") for one in problems)
        return cls(tokens)

    def owner(self, presented: str) -> Identity | None:
        """Whose it is. Takes as long for a nearly right one as for any other."""
        hashed = hash_token(presented).encode()
        found = None
        for token in self._tokens:
            if hmac.compare_digest(token.hashed, hashed):
                found = token.owner
        return found


_RIGHT = "no token; give name:role:sha256:..., as 'beacon token' prints it"


def _parsed(text: str) -> ApiToken | None:
    name, _, rest = text.partition(":")
    role, _, hashed = rest.partition(":")
    if not name or role not in set(Role) or not is_token_hash(hashed):
        return None
    return ApiToken(Identity(name, Role(role)), hashed.encode())
