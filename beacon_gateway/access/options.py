"""What can be configured about access; the reference for people is docs/configuration.md."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import attrs

from beacon_gateway.access.roles import Level, Role
from beacon_gateway.access.secrets import is_secret_hash

__all__ = ["AuthConfig", "ClientEntry", "CorsConfig", "RateLimitConfig", "TlsConfig"]

_OVERRIDE = re.compile(r"/[^\s:]*:[1-9][0-9]*")


def _origins(_: object, __: object, value: tuple[str, ...]) -> None:
    for origin in value:
        if origin != "*" and not re.fullmatch(r"[a-z][a-z0-9+.-]*://[^/\s]+", origin):
            raise ValueError(
                f"found {ascii(origin)[:60]}; give origins such as https://hmi.example:8443, or '*'"
            )


def _no_credentials_for_all(instance: CorsConfig, _: object, value: bool) -> None:  # noqa: FBT001
    if value and "*" in instance.allowed_origins:
        raise ValueError("not together with the origin '*': name the origins that may")


def _overrides(_: object, __: object, value: tuple[str, ...]) -> None:
    for entry in value:
        if not _OVERRIDE.fullmatch(entry):
            raise ValueError(
                f"found {ascii(entry)[:60]}; give a path and its requests per minute, such as "
                "/api/v1/apps/*:30"
            )


def _hash(_: object, __: object, value: str) -> None:
    if not is_secret_hash(value):
        raise ValueError("found no hash of a secret; make one with 'beacon token --client'")


def _key_for_clients(instance: AuthConfig, _: object, value: tuple[ClientEntry, ...]) -> None:
    signs = instance.secret_file if instance.algorithm == "HS256" else instance.private_key
    if value and signs is None:
        key = "secret_file" if instance.algorithm == "HS256" else "private_key"
        raise ValueError(f"their tokens need a key to be signed with; give {key}")


@attrs.frozen
class CorsConfig:
    """Which web pages from elsewhere may read the answers."""

    allowed_origins: tuple[str, ...] = attrs.field(default=(), validator=_origins)
    """None: no page may, and no answer has a CORS header."""
    allowed_methods: tuple[str, ...] = ("GET", "PUT", "POST", "DELETE", "OPTIONS")
    allowed_headers: tuple[str, ...] = ("Content-Type", "Accept", "Authorization")
    allow_credentials: bool = attrs.field(default=False, validator=_no_credentials_for_all)
    max_age_s: int = 86_400


@attrs.frozen
class RateLimitConfig:
    """How many requests a minute are answered."""

    enabled: bool = False
    client_rpm: int = attrs.field(default=60, metadata={"at_least": 1})
    """From one address; of IPv6 from one /64."""
    global_rpm: int = attrs.field(default=600, metadata={"at_least": 1})
    endpoints: tuple[str, ...] = attrs.field(default=(), validator=_overrides)
    """``pattern:rpm`` instead of ``client_rpm``; ``*`` stands for one step of the path."""


@attrs.frozen
class ClientEntry:
    """A program that gets tokens for its id and secret."""

    id: str
    secret_hash: str = attrs.field(validator=_hash)
    role: Role = Role.VIEWER


@attrs.frozen
class AuthConfig:
    """Who may ask."""

    require_auth_for: Level = Level.ALL
    tokens_file: Path | None = None
    algorithm: Literal["HS256", "RS256"] = "HS256"
    secret_file: Path | None = None
    private_key: Path | None = None
    public_key: Path | None = None
    issuer: str = "beacon"
    token_expiry_s: int = attrs.field(default=3600, metadata={"at_least": 1})
    refresh_token_expiry_s: int = attrs.field(default=86_400, metadata={"at_least": 1})
    clients: tuple[ClientEntry, ...] = attrs.field(default=(), validator=_key_for_clients)

    def located(self, folder: Path) -> AuthConfig:
        """The same with paths that begin in ``folder``."""
        names = ("tokens_file", "secret_file", "private_key", "public_key")
        given = {name: path for name in names if (path := getattr(self, name)) is not None}
        return attrs.evolve(self, **{name: folder / path for name, path in given.items()})


@attrs.frozen
class TlsConfig:
    """HTTPS instead of HTTP."""

    certificate: Path
    key: Path
    min_version: Literal["1.2", "1.3"] = "1.2"

    def located(self, folder: Path) -> TlsConfig:
        """The same with paths that begin in ``folder``."""
        return attrs.evolve(self, certificate=folder / self.certificate, key=folder / self.key)
