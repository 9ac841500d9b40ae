"""TLS for the HTTP server, with a certificate that can be renewed while it serves."""

from __future__ import annotations

import ssl

from beacon_core.errors import ConfigError
from beacon_gateway.access.options import TlsConfig

__all__ = ["renew", "server_context"]

_VERSIONS = {"1.2": ssl.TLSVersion.TLSv1_2, "1.3": ssl.TLSVersion.TLSv1_3}


def server_context(config: TlsConfig) -> ssl.SSLContext:
    """Raises ``ConfigError`` with one sentence for files that are no certificate and its key."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = _VERSIONS[config.min_version]
    context.set_alpn_protocols(["http/1.1"])
    _load(context, config)
    return context


def renew(context: ssl.SSLContext, config: TlsConfig) -> None:
    """Let new connections see the certificate that is in the files now; check it before with
    :func:`server_context`."""
    context.minimum_version = _VERSIONS[config.min_version]
    _load(context, config)


def _load(context: ssl.SSLContext, config: TlsConfig) -> None:
    for path in (config.certificate, config.key):
        if not path.is_file():
            raise ConfigError(f"$.http.tls: {path}: no such file")
    try:
        context.load_cert_chain(config.certificate, config.key, password=_no_password)
    except (ssl.SSLError, OSError, ValueError) as error:
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        raise ConfigError(
            f"$.http.tls: {config.certificate} and {config.key} are no certificate and its key "
            f"in PEM form, without a password: {str(reason).lower().replace('_', ' ')}"
        ) from error


def _no_password() -> str:
    # Without this OpenSSL would ask on the terminal.
    raise ValueError("the key has a password")
