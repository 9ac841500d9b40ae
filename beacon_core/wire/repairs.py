"""What the wire formats share: a bounded list of repairs, stamps, and mending text."""

from __future__ import annotations

import re

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_REPAIRS
from beacon_core.text import quoted
from beacon_core.validator import is_valid_id

__all__ = [
    "MAX_PROCESS_ID",
    "NS",
    "Repairs",
    "mended",
    "place",
    "process_id_of",
    "split_stamp",
    "utf8",
]

NS = 10**9
"""Nanoseconds in a second."""

MAX_PROCESS_ID = 2**32 - 1

_SURROGATE = re.compile("[\ud800-\udfff]")
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


class Repairs:
    """Collects repairs, at most ``MAX_REPAIRS`` of them. Thread rule: one thread."""

    def __init__(self) -> None:
        self._notes: list[str] = []
        self._count = 0

    def add(self, path: str, done: str) -> None:
        """Note that ``done`` was done to what stands at ``path``."""
        self._count += 1
        if self._count <= MAX_REPAIRS:
            self._notes.append(f"{path}: {done}")

    def all(self) -> tuple[str, ...]:
        """The repairs in order; when there are too many, the last entry says how many more."""
        if self._count <= MAX_REPAIRS:
            return tuple(self._notes)
        shown = self._notes[: MAX_REPAIRS - 1]
        return (*shown, f"... and {self._count - len(shown)} more")


def place(field: str, part: int | str | None = None) -> str:
    """The path of a field or of an entry in it; foreign keys in it are escaped and short."""
    if part is None:
        return f"$.{field}"
    if isinstance(part, str) and is_valid_id(part):
        return f"$.{field}.{part}"
    return f"$.{field}[{quoted(part) if isinstance(part, str) else part}]"


def mended(text: str) -> str:
    """The text with U+FFFD in the place of each lone surrogate, which UTF-8 cannot express."""
    return _SURROGATE.sub(_REPLACEMENT, text)


def utf8(text: str) -> bytes:
    """The text as bytes. Never raises; names from the operating system may hold surrogates."""
    try:
        return text.encode()
    except UnicodeEncodeError:
        return mended(text).encode()


def process_id_of(hint: BeaconHint) -> int:
    """The hint's process id, or :class:`UsageError` if no wire format can carry it."""
    if not 0 <= hint.process_id <= MAX_PROCESS_ID:
        raise UsageError(f"process_id={hint.process_id}: expected 0..{MAX_PROCESS_ID}")
    return hint.process_id


def split_stamp(stamp_ns: int, max_sec: int) -> tuple[int, int]:
    """Seconds and nanoseconds, or :class:`UsageError` if the format cannot carry the stamp."""
    sec, nanosec = divmod(stamp_ns, NS)
    if not 0 <= sec <= max_sec:
        last = (max_sec + 1) * NS - 1
        raise UsageError(f"stamp_ns={stamp_ns}: expected nanoseconds since 1970, 0..{last}")
    return sec, nanosec
