"""What can be configured of a relay's conduit over Zenoh, beside the session."""

from __future__ import annotations

import re
from typing import Any

import attrs

from beacon_core.errors import ConfigError
from beacon_zenoh.options import SessionOptions, ZenohOptions

__all__ = ["MAX_HEADER_BYTES", "RelayOptions"]

MAX_HEADER_BYTES = 256 * 1024
"""Twice what the largest digest needs."""

_LINK = re.compile(r"[A-Za-z0-9_.-]{1,64}")


def _link(_: object, attribute: attrs.Attribute[str], value: object) -> None:
    if not isinstance(value, str) or not _LINK.fullmatch(value):
        raise ConfigError(
            f"{attribute.name}: {value!r} cannot be used; write a name of letters, digits, '_', "
            "'.' or '-', 64 bytes at most"
        )


def _some_bytes(_: object, attribute: attrs.Attribute[int], value: Any) -> None:
    least = 2 * MAX_HEADER_BYTES
    if type(value) is not int or value < least:
        raise ConfigError(
            f"{attribute.name}: {value!r} cannot be used; write a number of bytes, {least} at least"
        )


@attrs.frozen
class RelayOptions(SessionOptions):
    """``conduit: zenoh`` in a configuration. ``ConfigError`` for a value that cannot be.

    Without a ``mode``, an end that is told where to listen is a router, any other one a client.
    """

    prefix: str = attrs.field(
        default="beacon",
        # The one that all dialects have.
        validator=attrs.fields(ZenohOptions).prefix.validator,
    )
    """What all keys begin with. Different prefixes do not hear each other."""
    link: str = attrs.field(default="default", validator=_link)
    """Ends with the same prefix and link hear each other."""
    send_bytes: int = attrs.field(default=64 * 1024 * 1024, validator=_some_bytes)
    """So much may wait to be sent; what is more is refused. So also no frame may be larger."""
