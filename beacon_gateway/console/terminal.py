"""What goes to stdout: data only, and nothing that could steer a terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping

from rich.console import Console
from rich.text import Text

__all__ = ["STATUS_STYLES", "cell", "console", "duration", "printable", "write_json"]

STATUS_STYLES: Mapping[str, str] = {
    "active": "green",
    "stale": "yellow",
    "left": "dim",
    "conflict": "bold red",
}
"""How rich shows each status that an entity with a beacon can have."""

_PLAIN_WIDTH = 160
"""Columns where there is no terminal to ask: wide enough that nothing is cut in a file or pipe."""


def printable(text: str) -> str:
    """The text with every character escaped that a terminal might act on.

    What robots say of themselves comes from outside, and may hold escape sequences.
    """
    if text.isprintable():
        return text
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)


def cell(value: object, style: str = "") -> Text:
    """One cell of a table; foreign text is never read as markup."""
    return Text(printable(str(value)), style=style)


def console() -> Console:
    """The console for stdout, as it is at this moment."""
    return Console(file=sys.stdout, width=None if sys.stdout.isatty() else _PLAIN_WIDTH)


def write_json(value: object, *, indent: int | None = 2) -> None:
    """A JSON document on stdout, with a newline; ``indent=None`` for one line."""
    text = json.dumps(value, ensure_ascii=False, indent=indent)
    # Outside strings JSON has no character but newlines that is not printable.
    safe = "".join(
        char if char.isprintable() or char == "\n" else json.dumps(char)[1:-1] for char in text
    )
    sys.stdout.write(f"{safe}\n")
    sys.stdout.flush()


def duration(seconds: float) -> str:
    """A duration in few characters: ``0.4 s``, ``12 s``, ``3 min``, ``2 h``, ``5 d``."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    for size, unit in ((86_400, "d"), (3_600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
