"""May it be served there? The loopback is this machine's own; anything else is a decision."""

from __future__ import annotations

import ipaddress

from beacon_core.errors import ConfigError
from beacon_gateway.access.auth import covers_everything
from beacon_gateway.config import HttpConfig

__all__ = ["check_exposure"]


def check_exposure(config: HttpConfig) -> str:
    """A warning, or nothing. Raises ``ConfigError`` for what nobody has decided."""
    missing = [
        what
        for what, there in (
            ("TLS ($.http.tls)", config.tls is not None),
            ("authentication for reading ($.http.auth)", covers_everything(config.auth)),
        )
        if not there
    ]
    if _is_loopback(config.host) or not missing:
        return ""
    what, where = " and ".join(missing), config.host or "every address"
    if config.allow_insecure:
        return f"serving on {where} without {what}: whoever reaches it can read everything"
    raise ConfigError(
        f"$.http.host: serving on {where} needs {what}, or a decision to do without: "
        "http.allow_insecure: true, or --allow-insecure"
    )


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
