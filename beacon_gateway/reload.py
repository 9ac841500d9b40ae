"""Another configuration for a gateway that goes on serving.

Everything is read and made first; only if nothing is wrong with any of it does it take the place of
what was. What cannot change while serving is said, one line each, and stays as it was.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import attrs

from beacon_core.errors import ConfigError
from beacon_gateway.access.access import Access
from beacon_gateway.access.exposure import check_exposure
from beacon_gateway.config import Config, HttpConfig, Loaded, read_manifest
from beacon_gateway.gateway import Gateway
from beacon_gateway.server import HttpServer
from beacon_gateway.tls import renew, server_context

__all__ = ["Reload"]

_log = logging.getLogger(__name__)

_LIVE = frozenset(
    {
        "entities",
        "manifest",
        "strict_manifest",
        "server_name",
        "server_version",
        "vendor_name",
        "log_level",
        "log_format",
    }
)
"""What may change while serving."""

_LIVE_HTTP = frozenset({"allow_insecure", "auth", "cors", "rate_limit", "max_body_bytes"})


class Reload:
    """Thread rule: one thread at a time."""

    def __init__(
        self,
        read: Callable[[], Loaded],
        gateway: Gateway,
        access: Access,
        server: HttpServer,
        log: Callable[[Config], None],
    ) -> None:
        """``read`` gives the configuration as it is now, or raises ``ConfigError``; ``log`` puts
        its way of logging in force."""
        self._read, self._gateway, self._access = read, gateway, access
        self._server, self._log = server, log

    def __call__(self) -> bool:
        """Take over what can be; whether the configuration was a good one. Never raises for a bad
        one."""
        try:
            loaded = self._read()
            changed = _needs_restart(self._gateway.config, loaded.config)
            config = _without(loaded.config, self._gateway.config)
            warning = check_exposure(config.http)
            manifest = read_manifest(config)
            rules = self._access.prepared(config.http)
            if config.http.tls is not None:
                server_context(config.http.tls)
        except ConfigError as error:
            _log.error("not reloaded, the old configuration stays: %s", error)
            return False
        self._log(config)
        self._access.put(rules, config.http)
        if config.http.tls is not None and self._server.tls is not None:
            renew(self._server.tls, config.http.tls)
        self._gateway.take_config(config, manifest)
        for line in (*map(str, loaded.corrections), warning):
            if line:
                _log.warning("%s", line)
        for path in changed:
            _log.warning("%s has changed: that needs a restart, until then it stays", path)
        _log.info("reloaded")
        return True


def _needs_restart(old: Config, new: Config) -> list[str]:
    """The paths of what is another, and cannot be while serving."""
    return [
        *_differing("$", old, new, _LIVE | {"http"}),
        *_differing("$.http", old.http, new.http, _LIVE_HTTP),
    ]


def _differing(
    path: str, old: attrs.AttrsInstance, new: attrs.AttrsInstance, live: frozenset[str]
) -> list[str]:
    names = [field.name for field in attrs.fields(type(old)) if field.name not in live]
    return [f"{path}.{name}" for name in names if getattr(old, name) != getattr(new, name)]


def _without(new: Config, old: Config) -> Config:
    """The new one with the old one's values where those cannot change."""
    http: HttpConfig = attrs.evolve(
        old.http, **{name: getattr(new.http, name) for name in _LIVE_HTTP}
    )
    return attrs.evolve(old, http=http, **{name: getattr(new, name) for name in _LIVE})
