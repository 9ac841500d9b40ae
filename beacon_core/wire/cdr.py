"""A hint as ROS 2 writes it: ``ros2_medkit_msgs/msg/MedkitDiscoveryHint`` in plain CDR (XCDR1).

Layout, after a header of four bytes (0, byte order, two bytes of options that nobody reads): the
fields in the order of :class:`~beacon_core.hint.BeaconHint`, then the stamp. A string is its
length in bytes with a terminating NUL, then those bytes; a sequence is its count, then its
entries; a metadata entry is two strings. Lengths, counts and numbers are 32 bits and begin at a
multiple of four after the header; as the header is four long too, that is one of the payload.

Senders differ, so these are taken: either byte order, any bytes as padding (FastCDR leaves it
uninitialised), any bytes after the message, a string without its NUL, and one of length 0 for an
empty string (both as FastCDR does). Everything else is refused with the place where it went wrong.

Decoding has two roads. The first walks the message as an array of words and gives up at the first
oddity; the second then starts again, checks before each step, and can say where it is.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Mapping, Sequence
from struct import Struct

from beacon_core.hint import NO_METADATA, Announcement, BeaconHint
from beacon_core.ports.adapter import Malformed
from beacon_core.repairs import Repairs, place
from beacon_core.wire.common import NS, process_id_of, split_stamp, utf8

__all__ = ["MAX_STAMP_SEC", "decode", "encode"]

MAX_STAMP_SEC = 2**31 - 1
"""``builtin_interfaces/Time`` counts seconds in an int32: stamps end in 2038."""


def encode(hint: BeaconHint, stamp_ns: int = 0, *, big_endian: bool = False) -> bytes:
    """Write a hint down; padding is zero, so the same hint gives the same bytes.

    Lone surrogates become U+FFFD. Raises :class:`beacon_core.errors.UsageError` for a
    ``process_id`` outside 0..2^32-1 and for a ``stamp_ns`` that is negative or past
    ``MAX_STAMP_SEC``. Thread rule: any thread.
    """
    word = (_BIG if big_endian else _LITTLE).pack
    parts = [_HEADER_BIG if big_endian else _HEADER_LITTLE]

    def strings(*texts: str) -> None:
        for text in texts:
            data = utf8(text)
            parts.extend((word(len(data) + 1), data, _ENDS[len(data) & 3]))

    strings(hint.entity_id, hint.stable_id, hint.display_name)
    for entries in (hint.function_ids, hint.depends_on):
        parts.append(word(len(entries)))
        strings(*entries)
    strings(hint.component_id, hint.transport_type, hint.negotiated_format)
    parts.append(word(process_id_of(hint)))
    strings(hint.process_name, hint.hostname)
    parts.append(word(len(hint.metadata)))
    for entry in hint.metadata.items():
        strings(*entry)
    parts.extend(map(word, split_stamp(stamp_ns, MAX_STAMP_SEC)))
    return b"".join(parts)


def decode(payload: bytes) -> Announcement | Malformed:
    """Read a hint. Any bytes in, a value out: it never raises. Thread rule: any thread.

    Text that is not UTF-8 is repaired with U+FFFD and an impossible stamp cleared, both reported;
    ids and lengths are the validator's business. Of a metadata key that is repeated the last one
    counts.
    """
    try:
        return _plain(payload)
    except _ODDITIES:
        pass
    try:
        return _Reader(payload).announcement()
    except _RefusedError as refused:
        return Malformed(str(refused))


_LITTLE, _BIG = Struct("<I"), Struct(">I")
_HEADER_LITTLE, _HEADER_BIG = b"\0\1\0\0", b"\0\0\0\0"
_WORD = {_HEADER_LITTLE[:2]: _LITTLE, _HEADER_BIG[:2]: _BIG}
_NATIVE, _FOREIGN = list(_WORD) if sys.byteorder == "little" else list(_WORD)[::-1]

# The NUL and the padding behind a string, by its length modulo 4.
_ENDS = (b"\0\0\0\0", b"\0\0\0", b"\0\0", b"\0")

# What an entry takes at least: the length of each of its strings.
_MIN_ID, _MIN_PAIR = 4, 8


class _OddError(Exception):
    """The first road ends here."""


_ODDITIES = (_OddError, IndexError, UnicodeDecodeError)


class _RefusedError(Exception):
    """The message is malformed; the text says where and how."""


def _plain(payload: bytes) -> Announcement:
    """Read a message that needs no second look; raises one of ``_ODDITIES`` if it does.

    Lengths are not compared with what is left: a length that is too long leads past the end,
    where no word is. ``at`` counts words; the string behind the length at ``at`` begins at byte
    ``4 * at + 4``.
    """
    words = _words(payload)
    at = 1

    def string() -> str:
        nonlocal at
        start = at + 1 << 2
        nul = start + words[at] - 1
        if payload[nul]:
            raise _OddError
        at = nul + 4 >> 2
        return payload[start:nul].decode()

    def count(strings_each: int) -> int:
        nonlocal at
        entries = words[at]
        at += 1
        # Each string takes a word at least. Without this, a lie would be walked to the end.
        if entries * strings_each > len(words) - at:
            raise _OddError
        return entries

    entity_id, stable_id, display_name = string(), string(), string()
    function_ids = [string() for _ in range(count(1))]
    depends_on = [string() for _ in range(count(1))]
    component_id, transport_type, negotiated_format = string(), string(), string()
    process_id = words[at]
    at += 1
    process_name, hostname = string(), string()
    metadata = {string(): string() for _ in range(count(2))}
    sec, nanosec = words[at], words[at + 1]
    if sec > MAX_STAMP_SEC or nanosec >= NS:
        raise _OddError
    return Announcement(
        BeaconHint(
            entity_id,
            stable_id,
            display_name,
            tuple(function_ids),
            tuple(depends_on),
            component_id,
            transport_type,
            negotiated_format,
            process_id,
            process_name,
            hostname,
            metadata or NO_METADATA,
        ),
        sec * NS + nanosec,
    )


def _words(payload: bytes) -> Sequence[int]:
    """The payload's words, the header being the first; what is left behind the last is left out."""
    order, whole = payload[:2], len(payload) & -4
    if order == _NATIVE:
        return memoryview(payload)[:whole].cast("I")
    if order != _FOREIGN:
        raise _OddError
    words = array("I", payload[:whole])
    words.byteswap()
    return words


class _Reader:
    """Reads step by step, checks before it takes, and notes what it had to clear or mend."""

    def __init__(self, payload: bytes) -> None:
        self._payload = payload
        self._at = 4
        self._repairs = Repairs()
        if len(payload) < self._at:
            raise _RefusedError(f"$: {len(payload)} bytes, too short for a header")
        if payload[:2] not in _WORD:
            raise _RefusedError(f"$: header {payload[:4].hex()} is not that of plain CDR")
        self._unpack = _WORD[payload[:2]].unpack_from

    def announcement(self) -> Announcement:
        # The arguments are evaluated in this order, which is that of the wire.
        hint = BeaconHint(
            entity_id=self._string("entity_id"),
            stable_id=self._string("stable_id"),
            display_name=self._string("display_name"),
            function_ids=self._strings("function_ids"),
            depends_on=self._strings("depends_on"),
            component_id=self._string("component_id"),
            transport_type=self._string("transport_type"),
            negotiated_format=self._string("negotiated_format"),
            process_id=self._word("process_id"),
            process_name=self._string("process_name"),
            hostname=self._string("hostname"),
            metadata=self._metadata(),
        )
        return Announcement(hint, self._stamp(), self._repairs.all())

    def _strings(self, field: str) -> tuple[str, ...]:
        count = self._count(field, _MIN_ID)
        return tuple([self._string(field, index) for index in range(count)])

    def _metadata(self) -> Mapping[str, str]:
        entries = {}
        for index in range(self._count("metadata", _MIN_PAIR)):
            key, clean = self._text("metadata", index)
            if not clean:
                self._repairs.note("key not UTF-8, replaced", "metadata", key)
            entries[key] = self._string("metadata", key)
        return entries or NO_METADATA

    def _stamp(self) -> int:
        sec, nanosec = self._word("stamp"), self._word("stamp")
        if sec <= MAX_STAMP_SEC and nanosec < NS:
            return sec * NS + nanosec
        signed = sec if sec <= MAX_STAMP_SEC else sec - 2**32
        self._repairs.note(f"sec {signed}, nanosec {nanosec} is no time, cleared", "stamp")
        return 0

    def _string(self, field: str, part: int | str | None = None) -> str:
        text, clean = self._text(field, part)
        if not clean:
            self._repairs.note("not UTF-8, replaced", field, part)
        return text

    def _text(self, field: str, part: int | str | None) -> tuple[str, bool]:
        """The next string, and whether it was UTF-8."""
        length = self._word(field, part)
        left = len(self._payload) - self._at
        if length > left:
            raise _RefusedError(f"{place(field, part)}: {length} bytes of text, {left} left")
        end = self._at + length
        data = self._payload[self._at : end].removesuffix(b"\0")
        self._at = end + 3 & -4
        try:
            return data.decode(), True
        except UnicodeDecodeError:
            return data.decode(errors="replace"), False

    def _count(self, field: str, min_bytes: int) -> int:
        count = self._word(field)
        left = len(self._payload) - self._at
        if count * min_bytes > left:
            raise _RefusedError(f"{place(field)}: {count} entries, {left} bytes left")
        return count

    def _word(self, field: str, part: int | str | None = None) -> int:
        # The padding before it may be missing too.
        left = max(0, len(self._payload) - self._at)
        if left < 4:
            raise _RefusedError(f"{place(field, part)}: 4 bytes expected, {left} left")
        (word,) = self._unpack(self._payload, self._at)
        self._at += 4
        return int(word)
