"""From options to a Zenoh configuration: defaults, then the file, then inline, then by name."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import zenoh

from beacon_core.errors import ConfigError
from beacon_zenoh.options import DEFAULT_ENDPOINT, Mode, SessionOptions, TlsOptions

__all__ = ["SessionConfig", "reason", "session_config"]

_Document = dict[str, Any]

_DEFAULTS: _Document = {
    # Multicast takes minutes to find somebody, and then it may be a stranger. Without it there is
    # nothing to wait for; a router would wait 500 ms before it listens.
    "scouting": {"multicast": {"enabled": False}, "delay": 0},
    "connect": {
        # Zenoh waits 1, 2, 4 s; this way a router that is back is found within half a second.
        "retry": {
            "period_init_ms": 100,
            "period_max_ms": 500,
            "period_increase_factor": 1.5,
        },
    },
    "transport": {
        # 352 sessions at most per host, and memory that stays locked: not for hints of 500 bytes.
        "shared_memory": {"enabled": False},
        "unicast": {
            # Zenoh's 1000 and 100 turn a fleet away; 10,000 is also rmw_zenoh's choice.
            "max_sessions": 10_000,
            "accept_pending": 1_000,
            # The other side speaks another protocol (tls to tcp) or hangs; Zenoh waits 10 s.
            "open_timeout": 3_000,
        },
        "link": {
            "tx": {
                # A hung or unplugged robot is noticed after this, in ms; Zenoh's 10 s is a ttl.
                "lease": 2_000,
                # Room for 2,000 hints said at once, 64 KiB each step; Zenoh's 2 hold 250.
                "queue": {"size": {"data": 16}},
            }
        },
    },
}

_FILES = (
    "transport/link/tls/root_ca_certificate",
    "transport/link/tls/listen_certificate",
    "transport/link/tls/listen_private_key",
    "transport/link/tls/connect_certificate",
    "transport/link/tls/connect_private_key",
    "transport/auth/usrpwd/dictionary_file",
)
"""Zenoh says nothing but "Timeout" if one of these is not there."""

_SOURCE_PLACE = re.compile(r"( at)? ?/\S+\.rs:\d+\.?")


@attrs.frozen
class SessionConfig:
    """What a session is opened with, and what to say about it."""

    mode: Mode
    connect: tuple[str, ...]
    listen: tuple[str, ...]
    document: Mapping[str, Any] = attrs.field(repr=False)

    def make(self) -> zenoh.Config:
        """A new Zenoh configuration: a session consumes it."""
        return zenoh.Config.from_json5(json.dumps(self.document))


def session_config(
    options: SessionOptions, default_mode: Mode, defaults: Mapping[str, Any] | None = None
) -> SessionConfig:
    """Put together what the options say. Reads files; connects to nothing.

    ``defaults`` are what the caller wants other than ours, unless a file or the options say more.

    Raises ``ConfigError`` for what Zenoh refuses and for files that cannot be read.
    """
    document = _merged(_merged(_DEFAULTS, defaults or {}), _file(options.config_file))
    document = _merged(document, _inline(options.config))
    document = _merged(document, _named(options))
    mode = document.setdefault("mode", default_mode)
    document = _endpoints(document, mode)
    if mode != "peer":
        # Gossip is how peers get past a router, and past its access control.
        document = _merged({"scouting": {"gossip": {"enabled": False}}}, document)
    _check_files(document)
    return SessionConfig(
        mode=mode,
        connect=tuple(document["connect"]["endpoints"]),
        listen=tuple(document["listen"]["endpoints"]),
        document=document,
    )


def reason(error: Exception) -> str:
    """Zenoh's words without the places in its source code."""
    return _SOURCE_PLACE.sub("", str(error)).strip().rstrip(".")


def _named(options: SessionOptions) -> _Document:
    """The options that have names of their own, where Zenoh keeps them."""
    document: _Document = {}
    if options.mode is not None:
        document["mode"] = options.mode
    for name in ("connect", "listen"):
        if endpoints := getattr(options, name):
            document[name] = {"endpoints": list(endpoints)}
    auth = {
        "user": options.user,
        "password": options.password,
        "dictionary_file": options.users_file,
    }
    if given := {key: value for key, value in auth.items() if value}:
        document["transport"] = {"auth": {"usrpwd": given}}
    if options.tls is not None:
        document = _merged(document, {"transport": {"link": {"tls": _tls(options.tls)}}})
    return document


def _tls(tls: TlsOptions) -> _Document:
    document: _Document = {"root_ca_certificate": tls.ca} if tls.ca else {}
    if tls.certificate:
        for side in ("listen", "connect"):
            document[f"{side}_certificate"] = tls.certificate
            document[f"{side}_private_key"] = tls.key
    if tls.ca and tls.certificate:
        document["enable_mtls"] = True
        # A certificate that runs out while connected ends the connection, as it would not begin.
        document["close_link_on_expiration"] = True
    return document


def _endpoints(document: _Document, mode: Mode) -> _Document:
    """The document with somewhere to connect or listen: Zenoh's own default is everywhere."""
    connect = _for_mode(document.get("connect", {}).get("endpoints"), mode)
    listen = _for_mode(document.get("listen", {}).get("endpoints"), mode)
    if mode == "client" and not connect:
        connect = (DEFAULT_ENDPOINT,)
    elif mode == "router" and not listen:
        listen = (DEFAULT_ENDPOINT,)
    elif mode == "peer" and not listen:
        listen = ("tcp/127.0.0.1:0",)
    places = {"connect": connect, "listen": listen}
    return _merged(document, {name: {"endpoints": list(at)} for name, at in places.items()})


def _for_mode(endpoints: Any, mode: Mode) -> tuple[str, ...]:
    """Zenoh takes a list, or a list for each mode."""
    if isinstance(endpoints, Mapping):
        endpoints = endpoints.get(mode, ())
    return tuple(str(one) for one in endpoints) if isinstance(endpoints, list | tuple) else ()


def _inline(config: Mapping[str, Any]) -> _Document:
    try:
        zenoh.Config.from_json5(json.dumps(config))
    except (TypeError, ValueError) as error:
        raise ConfigError(f"config: not what JSON can hold: {error}") from error
    except zenoh.ZError as error:
        raise ConfigError(f"config: Zenoh refuses it: {reason(error)}") from error
    return dict(config)


def _file(path: str) -> _Document:
    if not path:
        return {}
    try:
        text = Path(path).read_text("utf-8")
        # For its error messages, which name the line.
        zenoh.Config.from_json5(text)
        # Zenoh is the JSON5 parser at hand; as metadata it keeps a document as it is, where its
        # own Config would add all of Zenoh's defaults, and then ours could not be told from them.
        whole = zenoh.Config.from_json5(f"{{metadata:{text}\n}}")
        document = json.loads(whole.get_json("metadata"))
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is not UTF-8"
        raise ConfigError(f"config_file: {path!r} cannot be read: {why}") from error
    except zenoh.ZError as error:
        raise ConfigError(
            f"config_file: {path!r} is no Zenoh configuration in JSON5: {reason(error)}"
        ) from error
    if not isinstance(document, dict):
        raise ConfigError(f"config_file: {path!r} holds no object; write {{...}}")
    return document


def _check_files(document: _Document) -> None:
    for key in _FILES:
        value: Any = document
        for step in key.split("/"):
            value = value.get(step) if isinstance(value, Mapping) else None
        if not value:
            continue
        try:
            Path(str(value)).read_bytes()
        except OSError as error:
            raise ConfigError(
                f"{key}: {value!r} cannot be read: {error.strerror}; write the path of a file"
            ) from error


def _merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> _Document:
    """Both documents; where they differ, ``above`` holds. ``None`` is "not given", as for Zenoh."""
    result = dict(below)
    for key, value in above.items():
        if value is None:
            continue
        under = result.get(key)
        if isinstance(under, Mapping) and isinstance(value, Mapping):
            result[key] = _merged(under, value)
        else:
            result[key] = value
    return result
