"""What travels beside each message of rmw_zenoh: who sent it, in what order, and when.

Layout, as Zenoh's own serializer writes it, without padding::

    i64 LE  sequence: of this publisher, from 1
    i64 LE  stamp: the publisher's wall clock, nanoseconds since 1970
    varint  16, the length of what follows
    16 x u8 GID: the publisher's number

rmw_zenoh drops messages without it. Bytes behind it are ignored, as its reader ignores them.
"""

from __future__ import annotations

import struct

__all__ = ["GID_BYTES", "Envelope", "decode", "encode"]

GID_BYTES = 16
"""``RMW_GID_STORAGE_SIZE`` of ROS."""

Envelope = tuple[bytes, int, int]
"""GID, sequence, stamp in nanoseconds: a bare tuple, because one is made per message."""

_LAYOUT = struct.Struct("<qqB16s")
_HEAD = struct.Struct("<qq")
_unpack = _LAYOUT.unpack_from
_PLAIN = _LAYOUT.size

_MAX_VARINT = 10
"""Bytes of the longest 64-bit number, seven bits in each."""


def encode(gid: bytes, sequence: int, stamp_ns: int) -> bytes:
    """Write it down. Only for our own values: what is out of range raises."""
    return _LAYOUT.pack(sequence, stamp_ns, GID_BYTES, gid)


def decode(attachment: bytes) -> Envelope | None:
    """Read it; ``None`` for anything that is not in this layout. Never raises.

    A sequence or a stamp below 0 is "not given", which is 0.
    """
    if len(attachment) < _PLAIN:
        return None
    sequence, stamp_ns, length, gid = _unpack(attachment)
    if length != GID_BYTES:
        gid = _behind_a_longer_number(attachment)
        if gid is None:
            return None
    return gid, max(sequence, 0), max(stamp_ns, 0)


def _behind_a_longer_number(attachment: bytes) -> bytes | None:
    """The GID, if its length is written with more digits than it needs."""
    length = shift = 0
    for at in range(_HEAD.size, min(_HEAD.size + _MAX_VARINT, len(attachment))):
        length |= (attachment[at] & 0x7F) << shift
        shift += 7
        if attachment[at] < 0x80:
            gid = attachment[at + 1 : at + 1 + GID_BYTES]
            return gid if length == len(gid) == GID_BYTES else None
    return None
