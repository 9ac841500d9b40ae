"""Plain CDR (XCDR1), value by value, both ways; :mod:`.messages` knows what messages are made of.

After a header of four bytes (0, byte order, two bytes of options that nobody reads), each number
begins at a multiple of its own size, counted from behind the header. A string is its length with a
terminating NUL, then those bytes; a sequence is its count, then its entries. Where there are no
entries there is no padding for them either.

Senders differ, so these are taken: either byte order, any bytes as padding, any bytes after the
message, a string without its NUL, and one of length 0 for an empty string (FastCDR writes all of
these). Text that is not UTF-8 is repaired with U+FFFD.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from beacon_core.wire.common import utf8

__all__ = ["NoMessageError", "Reader", "Writer"]

_HEADER = b"\0\1\0\0"
_ORDERS = {b"\0\1": "<", b"\0\0": ">"}


class NoMessageError(Exception):
    """These bytes are no such message."""


class Writer:
    """Little-endian, with zeros as padding, so the same values give the same bytes."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def numbers(self, code: str, values: Sequence[float]) -> None:
        """Values of one of :mod:`struct`'s types, one behind the other."""
        if not values:
            return
        self._bytes += bytes(-len(self._bytes) % struct.calcsize(code))
        self._bytes += struct.pack(f"<{len(values)}{code}", *values)

    def sequence(self, code: str, values: Sequence[float]) -> None:
        """The same as a sequence."""
        self.count(len(values))
        self.numbers(code, values)

    def count(self, entries: int) -> None:
        """What a sequence begins with."""
        self.numbers("I", (entries,))

    def text(self, text: str) -> None:
        """A string. It ends at a NUL, as it would for whoever reads it."""
        data = utf8(text.partition("\0")[0])
        self.count(len(data) + 1)
        self._bytes += data + b"\0"

    def texts(self, texts: Sequence[str]) -> None:
        """A sequence of strings."""
        self.count(len(texts))
        for text in texts:
            self.text(text)

    def message(self) -> bytes:
        """All of it, with the header."""
        return _HEADER + bytes(self._bytes)


class Reader:
    """Every method raises :class:`NoMessageError` where the bytes end too early, and never anything
    else. No length is believed before as many bytes are seen to be there."""

    def __init__(self, payload: bytes) -> None:
        if payload[:2] not in _ORDERS or len(payload) < len(_HEADER):
            raise NoMessageError
        self._order = _ORDERS[payload[:2]]
        self._bytes = payload[len(_HEADER) :]
        self._at = 0

    def numbers(self, code: str, count: int) -> Sequence[int]:
        """So many values of one of :mod:`struct`'s types of whole numbers."""
        found: Sequence[int] = self._unpacked(code, count)
        return found

    def floats(self, count: int) -> Sequence[float]:
        """So many float64."""
        found: Sequence[float] = self._unpacked("d", count)
        return found

    def number(self, code: str) -> int:
        """A whole number."""
        return self.numbers(code, 1)[0]

    def count(self, least_bytes: int) -> int:
        """How many entries a sequence has, each of which takes at least so many bytes."""
        count = self.number("I")
        if count * least_bytes > len(self._bytes) - self._at:
            raise NoMessageError
        return count

    def text(self) -> str:
        """A string."""
        end = self._at_text()
        data, self._at = self._bytes[self._at : end], end
        return data.removesuffix(b"\0").decode(errors="replace")

    def texts(self) -> list[str]:
        """A sequence of strings."""
        return [self.text() for _ in range(self.count(4))]

    def _at_text(self) -> int:
        length = self.number("I")
        if length > len(self._bytes) - self._at:
            raise NoMessageError
        return self._at + length

    def _unpacked(self, code: str, count: int) -> tuple[int, ...]:
        if not count:
            return ()
        size = struct.calcsize(code)
        start = self._at + -self._at % size
        if count * size > len(self._bytes) - start:
            raise NoMessageError
        self._at = start + count * size
        return struct.unpack_from(f"{self._order}{count}{code}", self._bytes, start)
