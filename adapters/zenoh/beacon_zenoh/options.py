"""What can be configured: the usual by name, everything else in Zenoh's own words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Literal

import attrs

from beacon_core.errors import ConfigError

__all__ = ["DEFAULT_ENDPOINT", "Mode", "SessionOptions", "TlsOptions", "ZenohOptions"]

Mode = Literal["router", "client", "peer"]
"""What a session is on the network. A client only connects; the other two can listen, too."""

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Zenoh's usual port, and this machine only: to open it to a network is a decision."""

_MODES = ("router", "client", "peer")
_PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws", "unixsock-stream")
_ENDPOINT = re.compile(rf"({'|'.join(_PROTOCOLS)})/\S+")
_PREFIX = re.compile(r"[A-Za-z0-9_.-]+(/[A-Za-z0-9_.-]+)*")
_MAX_PREFIX = 128


def _complain(attribute: attrs.Attribute[Any], value: object, right: str) -> None:
    raise ConfigError(f"{attribute.name}: {value!r} cannot be used; write {right}")


def _mode(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None and value not in _MODES:
        _complain(attribute, value, f"one of {', '.join(_MODES)}, or leave it out")


def _endpoints(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    right = f"a list such as ['{DEFAULT_ENDPOINT}'], with {', '.join(_PROTOCOLS)}"
    if not isinstance(value, tuple):
        _complain(attribute, value, right)
    for one in value if isinstance(value, tuple) else ():
        if not isinstance(one, str) or not _ENDPOINT.fullmatch(one):
            _complain(attribute, one, right)


def _prefix(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or len(value) > _MAX_PREFIX or not _PREFIX.fullmatch(value):
        names = "names of letters, digits, '_', '.' or '-', with '/' between them"
        _complain(attribute, value, f"{names}, {_MAX_PREFIX} bytes at most")


def _text(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str):
        _complain(attribute, value, "a text")


def _password(instance: SessionOptions, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str):
        raise ConfigError(f"{attribute.name}: it is not a text; write a text")
    if bool(value) != bool(instance.user):
        raise ConfigError(f"{attribute.name}: give user and password both, or neither")


def _mapping(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        _complain(attribute, value, "keys of Zenoh's configuration, such as {access_control: ...}")


def _tls(_: object, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None and not isinstance(value, TlsOptions):
        _complain(attribute, value, "ca, certificate and key")


def _key(instance: TlsOptions, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or bool(value) != bool(instance.certificate):
        raise ConfigError(f"{attribute.name}: give certificate and key both, or neither")


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


@attrs.frozen
class TlsOptions:
    """PEM files for endpoints that begin with ``tls/`` or ``quic/``.

    With all three, each side proves who it is (mTLS): that is what access control needs. A client
    may give the ``ca`` alone, a router ``certificate`` and ``key`` alone: then only the router is
    proven.
    """

    ca: str = attrs.field(default="", validator=_text)
    """Who must have signed the other side's certificate."""
    certificate: str = attrs.field(default="", validator=_text)
    """Our own. A router's must name the hosts by which it is reached."""
    key: str = attrs.field(default="", validator=_key)
    """The private key of our certificate."""


@attrs.frozen
class SessionOptions:
    """What every dialect needs to be told of its Zenoh session.

    ``ConfigError`` for a value that cannot be. What needs a look at files, or at Zenoh itself, is
    looked at when the source or announcer is made.
    """

    mode: Mode | None = attrs.field(default=None, validator=_mode)
    """``router``: others connect to us; ``client``: we connect to a router, and wait for it;
    ``peer``: either. Left out: as suits the dialect."""
    connect: tuple[str, ...] = attrs.field(default=(), converter=_tuple, validator=_endpoints)
    """Where to connect to. A client that is given none connects to ``DEFAULT_ENDPOINT``; given
    several, to one of them, and to another when that fails."""
    listen: tuple[str, ...] = attrs.field(default=(), converter=_tuple, validator=_endpoints)
    """Where to listen. A router that is given none listens at ``DEFAULT_ENDPOINT``, a peer at a
    port of 127.0.0.1 that the system chooses, a client nowhere."""
    user: str = attrs.field(default="", validator=_text)
    """The name to show to a router that asks for one. On ``tcp/`` it travels unencrypted."""
    password: str = attrs.field(default="", validator=_password, repr=False)
    users_file: str = attrs.field(default="", validator=_text)
    """A router lets in only these: lines of ``user:password``."""
    tls: TlsOptions | None = attrs.field(default=None, validator=_tls)
    config_file: str = attrs.field(default="", validator=_text)
    """A file in Zenoh's own format (JSON5). Overrides our defaults."""
    config: Mapping[str, Any] = attrs.field(factory=dict, validator=_mapping, repr=False)
    """The same inline. Overrides ``config_file``; the options above override both."""


@attrs.frozen
class ZenohOptions(SessionOptions):
    """``adapter: zenoh`` in a configuration, of a source or of an announcer.

    Without a ``mode`` a source is its own router, and an announcer is a client.
    """

    prefix: str = attrs.field(default="beacon", validator=_prefix)
    """What all keys begin with. Different prefixes do not hear each other."""
