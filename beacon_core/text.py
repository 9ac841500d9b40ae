"""Foreign text made fit for a log line."""

from __future__ import annotations

import re

from beacon_core.limits import MAX_LOG_CHARS

__all__ = ["quoted"]

_WHOLE_ESCAPES = re.compile(r"(?:[^\\]|\\x..|\\u.{4}|\\U.{8}|\\[^xuU])*")


def quoted(text: str) -> str:
    """The text in quotes: printable ASCII on one line, at most ``MAX_LOG_CHARS`` long in all.

    Everything else is escaped as in a Python literal, so that a line cannot be forged, a terminal
    not steered, and a look-alike such as a Unicode digit is seen for what it is. Longer text is cut
    between two escapes and followed by ``...``. The cost does not grow with the text's length.
    """
    escaped = ascii(text[:MAX_LOG_CHARS])
    if len(escaped) <= MAX_LOG_CHARS:
        return escaped
    quote = escaped[0]
    room = MAX_LOG_CHARS - len(quote) - len("...")
    # The pattern matches the empty string too, so there always is a match.
    kept = next(_WHOLE_ESCAPES.finditer(escaped[:-1][:room])).group()
    return f"{kept}{quote}..."
