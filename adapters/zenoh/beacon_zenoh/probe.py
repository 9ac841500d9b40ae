"""Why an endpoint does not answer, in words: Zenoh itself says only that nothing came about."""

from __future__ import annotations

import socket
import ssl
from collections.abc import Mapping
from typing import Any

import attrs

__all__ = ["Place", "place", "why_no_tls", "why_unreachable"]

_STREAMS = ("tcp", "tls", "ws")
"""What begins with a TCP connection, and so can be tried without Zenoh."""

_REFUSAL_S = 0.3
"""How long a server may take to refuse a certificate: in TLS 1.3 that comes after the handshake."""

_WANTED_ANOTHER = ("CERTIFICATE", "UNKNOWN_CA", "ACCESS_DENIED")
"""What is in the names of the alerts by which a server refuses the client's certificate."""


@attrs.frozen
class Place:
    """What an endpoint such as ``tls/192.0.2.1:7447#key=value`` says."""

    protocol: str
    host: str
    port: int


def place(endpoint: str) -> Place | None:
    """Where it is; ``None`` if it is not a host and a port."""
    protocol, _, rest = endpoint.partition("/")
    address = rest.partition("#")[0].partition("?")[0]
    host, colon, port = address.rpartition(":")
    if not (colon and host and port.isascii() and port.isdigit()):
        return None
    return Place(protocol, host.strip("[]"), int(port))


def why_unreachable(at: Place, within_s: float) -> str:
    """Why nobody can be reached there; ``""`` if somebody can, or if it cannot be told."""
    if at.protocol not in _STREAMS:
        return ""
    try:
        socket.create_connection((at.host, at.port), within_s).close()
    except OSError as error:
        return _why_unreachable(error, at, within_s)
    return ""


def why_no_tls(at: Place, tls: Mapping[str, Any], within_s: float) -> str:
    """Why no TLS comes about there; ``""`` if it does.

    ``tls``: Zenoh's own keys, such as ``root_ca_certificate``.
    """
    try:
        context = _context(tls)
    except OSError as error:
        return f"the certificates of this configuration cannot be used: {error}"
    try:
        with (
            socket.create_connection((at.host, at.port), within_s) as connection,
            context.wrap_socket(connection, server_hostname=at.host) as secure,
        ):
            return _refused_late(secure)
    except OSError as error:
        return _why_no_tls(error)


def _why_unreachable(error: OSError, at: Place, within_s: float) -> str:
    match error:
        case socket.gaierror():
            return f"the name {at.host!r} is not known here"
        case ConnectionRefusedError():
            return "nobody listens there"
        case TimeoutError():
            return f"no answer within {within_s:g} s: not there, or a firewall in between"
    return f"it cannot be reached: {error.strerror or error}"


def _context(tls: Mapping[str, Any]) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=tls.get("root_ca_certificate"))
    # Zenoh is not as strict as Python has become.
    context.verify_flags &= ~ssl.VERIFY_X509_STRICT
    context.check_hostname = tls.get("verify_name_on_connect", True)
    if tls.get("connect_certificate"):
        context.load_cert_chain(tls["connect_certificate"], tls.get("connect_private_key"))
    return context


def _refused_late(secure: ssl.SSLSocket) -> str:
    secure.settimeout(_REFUSAL_S)
    try:
        secure.recv(1)
    except TimeoutError:
        return ""  # nothing was refused, and a Zenoh router waits for the client to speak
    return "it ended the connection as soon as TLS had come about"


def _why_no_tls(error: OSError) -> str:
    match error:
        case ssl.SSLCertVerificationError():
            return f"its certificate is not believed here: {error.verify_message}"
        case ssl.SSLError():
            said = error.reason or str(error)
            words = said.replace("_", " ").lower()
            if any(one in said for one in _WANTED_ANOTHER):
                return f"it does not take this configuration's certificate: {words}"
            return f"no TLS comes about: {words}"
        case TimeoutError():
            return "it answers, but not in TLS"
    return f"it ended the connection before TLS came about: {error.strerror or error}"
