"""Quality of service as rmw_zenoh writes it at the end of a token's key.

Six fields with ``:`` between them, their parts with ``,``::

    reliability:durability:history,depth:deadline s,ns:lifespan s,ns:liveliness,lease s,ns

A part that is empty has its default. What the default of ``depth`` is, writers do not agree upon:
rmw_zenoh leaves out 42, and zenoh-ros2-sdk writes its own default of 10. Any part may also be
written though it has the default, so both spellings are read.
"""

from __future__ import annotations

import attrs

__all__ = ["DEFAULT_QOS", "FOREVER", "Duration", "Qos", "decode", "encode"]

Duration = tuple[int, int]
"""Seconds and nanoseconds."""

FOREVER: Duration = (9_223_372_036, 854_775_807)
"""As ROS writes it: 2^63 - 1 ns."""


@attrs.frozen
class Qos:
    """The numbers are those of ``rmw/types.h``. The defaults are those of rmw_zenoh."""

    reliability: int = 1
    """1 reliable, 2 best effort."""
    durability: int = 2
    """1 transient local, 2 volatile."""
    history: int = 1
    """1 keep last, 2 keep all."""
    depth: int = 42
    deadline: Duration = FOREVER
    lifespan: Duration = FOREVER
    liveliness: int = 1
    """1 automatic, 3 manual by topic."""
    lease: Duration = FOREVER

    @property
    def keeps(self) -> bool:
        """Does who comes later get what was said before?"""
        return self.durability == _TRANSIENT_LOCAL


DEFAULT_QOS = Qos()
"""rmw_zenoh's."""

_TRANSIENT_LOCAL = 1

_SHAPE = (1, 1, 2, 2, 2, 3)
"""How many parts each field has."""

_BOUNDS = (4, 4, 3, 2**64 - 1, *(2**64 - 1,) * 4, 5, *(2**64 - 1,) * 2)
"""The highest value of each part: the last member of each enumeration; a ``size_t``."""

_MAX_LENGTH = 256
"""More than all parts need together."""


def encode(qos: Qos) -> str:
    """Write it down, without what has its default."""
    pairs = zip(_parts(qos), _DEFAULTS, strict=True)
    parts = iter(["" if value == default else str(value) for value, default in pairs])
    return ":".join(",".join(next(parts) for _ in range(count)) for count in _SHAPE)


def decode(text: str) -> Qos | None:
    """Read it; ``None`` for anything that is not in this form. Never raises."""
    fields = text.split(":") if len(text) <= _MAX_LENGTH else []
    parts = [field.split(",") for field in fields]
    if tuple(map(len, parts)) != _SHAPE:
        return None
    values: list[int] = []
    flat = [part for field in parts for part in field]
    for part, default, highest in zip(flat, _DEFAULTS, _BOUNDS, strict=True):
        if not part:
            values.append(default)
        elif part.isascii() and part.isdigit() and int(part) <= highest:
            values.append(int(part))
        else:
            return None
    reliability, durability, history, depth, *times, liveliness, sec, nanosec = values
    return Qos(
        reliability,
        durability,
        history,
        depth,
        deadline=(times[0], times[1]),
        lifespan=(times[2], times[3]),
        liveliness=liveliness,
        lease=(sec, nanosec),
    )


def _parts(qos: Qos) -> tuple[int, ...]:
    return (
        qos.reliability,
        qos.durability,
        qos.history,
        qos.depth,
        *qos.deadline,
        *qos.lifespan,
        qos.liveliness,
        *qos.lease,
    )


_DEFAULTS = _parts(DEFAULT_QOS)
