"""What the wire formats share: stamps, process ids, and text as bytes."""

from __future__ import annotations

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_PROCESS_ID
from beacon_core.repairs import mended

__all__ = [
    "NS",
    "process_id_of",
    "split_stamp",
    "utf8",
]

NS = 10**9
"""Nanoseconds in a second."""


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
