"""Repairs: what had to be done to a hint, in words, each as ``$.path: what was done``."""

from __future__ import annotations

import re

from beacon_core.limits import MAX_REPAIRS
from beacon_core.text import quoted

__all__ = ["Repairs", "mended", "place"]

_SURROGATE = re.compile("[\ud800-\udfff]")
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_PLAIN = re.compile(r"[A-Za-z0-9_-]{1,64}")


class Repairs:
    """Collects repairs, at most ``MAX_REPAIRS`` of them. Thread rule: one thread."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._count = 0

    def note(self, done: str, field: str, part: int | str | None = None) -> None:
        """Note that ``done`` was done to a field, or to the ``part`` of it: an index or a key.

        One note too many costs only its counting, so a hint of 60,000 faults is no attack.
        """
        self._count += 1
        if self._count <= MAX_REPAIRS:
            self._lines.append(f"{place(field, part)}: {done}")

    def all(self) -> tuple[str, ...]:
        """The repairs in order; if there are too many, the last entry says how many more."""
        if self._count <= MAX_REPAIRS:
            return tuple(self._lines)
        shown = self._lines[: MAX_REPAIRS - 1]
        return (*shown, f"... and {self._count - len(shown)} more")


def place(field: str, part: int | str | None = None) -> str:
    """The path of a field or of a part of it: ``$.depends_on[3]``, ``$.metadata.vendor``.

    A key that could be misread is escaped and short: ``$.metadata['a\\nb']``.
    """
    if part is None:
        return f"$.{field}"
    if isinstance(part, int):
        return f"$.{field}[{part}]"
    return f"$.{field}.{part}" if _PLAIN.fullmatch(part) else f"$.{field}[{quoted(part)}]"


def mended(text: str) -> str:
    """The text with U+FFFD in the place of each lone surrogate, which UTF-8 cannot express."""
    return _SURROGATE.sub(_REPLACEMENT, text)
