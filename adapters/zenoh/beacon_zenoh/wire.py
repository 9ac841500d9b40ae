"""What travels beside a hint: the attachment, which says who speaks, in what order, and when.

Layout, in this order and without padding::

    u8      1, the version of this layout
    u64 LE  sequence: rises with each message of one incarnation, from 1; 0 is "not given"
    i64 LE  stamp: the sender's wall clock, nanoseconds since 1970; 0 is "not given"
    text    incarnation: a name for this run of the announcer, 1..64 printable ASCII characters

It stands beside the payload and not in it so that an unchanged hint has unchanged bytes, which the
intake refreshes without decoding. A binary layout, because reading it takes a quarter of the time
of the same in text (0.24 against 0.93 us).

A message without an attachment is a message from somebody who knows no more than the hint itself.
"""

from __future__ import annotations

import struct

__all__ = ["MAX_INCARNATION_LENGTH", "NO_ENVELOPE", "Envelope", "decode", "encode"]

Envelope = tuple[str, int, int]
"""Incarnation, sequence, stamp in nanoseconds: a bare tuple, because one is made per message."""

NO_ENVELOPE: Envelope = ("", 0, 0)
"""Of a message without an attachment: nothing is given."""

MAX_INCARNATION_LENGTH = 64
"""Twice a UUID in hexadecimal digits."""

_VERSION = 1
_HEAD = struct.Struct("<BQq")
_unpack = _HEAD.unpack_from
_SHORTEST = _HEAD.size + 1
_LONGEST = _HEAD.size + MAX_INCARNATION_LENGTH


def encode(incarnation: str, sequence: int, stamp_ns: int) -> bytes:
    """Write it down. Only for our own values: what is out of range raises."""
    return _HEAD.pack(_VERSION, sequence, stamp_ns) + incarnation.encode("ascii")


def decode(attachment: bytes) -> Envelope | None:
    """Read it; ``None`` for anything that is not in this layout. Never raises."""
    if not _SHORTEST <= len(attachment) <= _LONGEST:
        return None
    version, sequence, stamp_ns = _unpack(attachment)
    incarnation = attachment[_HEAD.size :]
    if version != _VERSION or stamp_ns < 0 or not incarnation.isascii():
        return None
    name = incarnation.decode()
    return (name, sequence, stamp_ns) if name.isprintable() else None
