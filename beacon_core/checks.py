"""Checks of what a caller configures; each message names the key, the value and what is right."""

from __future__ import annotations

import math

from beacon_core.errors import ConfigError

__all__ = ["at_least_one", "nanoseconds", "positive_rate"]


_MAX_SECONDS = 1_000_000_000
"""30 years. The nanoseconds of a much longer time are beyond a float."""


def nanoseconds(key: str, seconds: float) -> int:
    """The smallest whole number of nanoseconds that is not less, as floating point sees it.

    So an age in nanoseconds reaches it exactly when C++'s ``duration<double>`` reaches ``seconds``.
    """
    if not 0 <= seconds <= _MAX_SECONDS:
        raise ConfigError(
            f"{key}: {seconds} is not possible; give a number of seconds from 0 to {_MAX_SECONDS}"
        )
    floor_ns = int(seconds * 1e9)
    return floor_ns if floor_ns / 1e9 >= seconds else floor_ns + 1


def at_least_one(key: str, value: int) -> int:
    """A cap on a number of things."""
    if not 1 <= value < math.inf:
        raise ConfigError(f"{key}: {value} is not possible; give a whole number, at least 1")
    return value


def positive_rate(key: str, value: float) -> float:
    """A rate or a burst, in tokens."""
    if not (math.isfinite(value) and value >= 1.0):
        raise ConfigError(f"{key}: {value} is not possible; give a finite number, at least 1.0")
    return float(value)
