"""The caller's mistakes. A peer's bad input never raises: it comes back as an ``Outcome``."""

from __future__ import annotations

__all__ = ["BeaconError", "ConfigError", "UsageError"]


class BeaconError(Exception):
    """Everything this package raises on purpose."""


class UsageError(BeaconError):
    """A method was called at a time or in a way its docstring excludes."""


class ConfigError(BeaconError):
    """A setting that cannot work; the message names the key, the value and what would be right."""
