"""Checks of what a caller configures; each message names the key, the value and what is right.

A value of another type is refused like one that is out of range: ``True`` is no number of anything
though Python counts with it, and ``"10"`` is a text. A whole number must be written as one.
"""

from __future__ import annotations

import math
import sys

from beacon_core.errors import ConfigError

__all__ = ["at_least_one", "nanoseconds", "period_ns", "positive_rate"]


_MAX_SECONDS = 1_000_000_000
"""30 years. The nanoseconds of a much longer time are beyond a float."""


def nanoseconds(key: str, seconds: float) -> int:
    """The smallest whole number of nanoseconds that is not less, as floating point sees it.

    So an age in nanoseconds reaches it exactly when C++'s ``duration<double>`` reaches ``seconds``.
    """
    if not (_is_number(seconds) and 0 <= seconds <= _MAX_SECONDS):
        raise _refused(key, seconds, f"a number of seconds from 0 to {_MAX_SECONDS}")
    floor_ns = int(seconds * 1e9)
    return floor_ns if floor_ns / 1e9 >= seconds else floor_ns + 1


def period_ns(period_s: float | None) -> int | None:
    """How often an announcer repeats, in nanoseconds; ``None``, only when told, stays ``None``."""
    if period_s is None:
        return None
    if not 0 < period_s < math.inf:
        raise ConfigError(f"period_s: {period_s!r} cannot be used; write seconds above 0")
    return round(period_s * 1e9)


def at_least_one(key: str, value: int) -> int:
    """A cap on a number of things."""
    if not (_is_number(value) and isinstance(value, int) and value >= 1):
        raise _refused(key, value, "a whole number, at least 1")
    return value


def positive_rate(key: str, value: float) -> float:
    """A rate or a burst, in tokens."""
    if not (_is_number(value) and 1.0 <= value <= sys.float_info.max):
        raise _refused(key, value, "a finite number, at least 1.0")
    return float(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _refused(key: str, value: object, right: str) -> ConfigError:
    return ConfigError(f"{key}: {value!r} is not possible; give {right}")
