"""The one thing to choose."""

from __future__ import annotations

import attrs

from beacon_core.errors import ConfigError

__all__ = ["LocalOptions"]


def _some_text(_: object, attribute: attrs.Attribute[str], value: object) -> None:
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{attribute.name}: {value!r} is not the name of a conduit; write a text")


@attrs.frozen
class LocalOptions:
    """``conduit: local`` in a configuration. ``ConfigError`` for a value that cannot be."""

    name: str = attrs.field(default="default", validator=_some_text)
    """Ends of this process that have the same name hear each other."""
