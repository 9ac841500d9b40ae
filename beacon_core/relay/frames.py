"""What the two sides say to each other, and how it is written: a header, and a payload beside it.

Theory. The three kinds of message are those of the original relay, by name and role::

    ADVERTISEMENT  forwarder -> republisher   this is the topic, its type, its quality of service
    CONTENT        forwarder -> republisher   a message, as opaque bytes
    RESET          republisher -> forwarder   advertise again, send these again, who is there?

and a fourth one, since what is said once and lost must be noticed::

    DIGEST         forwarder -> republisher   these are my routes, and so far have they come

Names and types travel in advertisements only. A route is a number for one topic, of one type, with
one quality of service, in one life of one forwarder; when any of these changes, it is another one.
So a content that names its route cannot be mistaken for one of another type.

The header of a content is 48 bytes. The payload is never looked at, joined to it or copied.
Numbers are little-endian. Whatever bytes come in, :func:`decode` gives a frame or ``Malformed``.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Iterable
from hashlib import blake2b

import attrs

from beacon_core.relay.values import Mode, Qos, TopicType

__all__ = [
    "CONTENT",
    "FLAGS_AT",
    "HEAD",
    "HEADER_BYTES",
    "KIND_AT",
    "MAX_DEFINITION_BYTES",
    "MAX_ENTRIES",
    "MAX_RANGES",
    "MAX_SPAN",
    "MAX_WANTED",
    "ROUTE_AT",
    "VERSION",
    "Advertisement",
    "Content",
    "Digest",
    "Entry",
    "Frame",
    "Kind",
    "Malformed",
    "Range",
    "Reset",
    "content_header",
    "decode",
    "encode",
    "fingerprint",
]

VERSION = 1
"""A frame of another version is refused, not guessed at."""

HEADER_BYTES = 48
"""Of a content: all that is sent besides its payload."""

MAX_ENTRIES = 4096
"""Routes in a digest: 96 KB. So many routes a forwarder may have."""

MAX_WANTED = 256
"""Advertisements asked for by one reset."""

MAX_RANGES = 32
"""Runs of missing contents asked for by one reset."""

MAX_SPAN = 256
"""Contents in one of them. So no reset, whoever wrote it, asks for more than 8,192."""

MAX_DEFINITION_BYTES = 1024 * 1024
"""Text of a type with all that it contains; the largest of ROS's own have 20 KB."""


class Kind(enum.IntEnum):
    """The first thing a reader needs to know of a frame."""

    ADVERTISEMENT = 1
    CONTENT = 2
    RESET = 3
    DIGEST = 4


@attrs.frozen
class Content:
    """One message."""

    origin: int
    """The forwarder that sends it, 64 bits."""
    epoch: int
    """The life of it: rises with each start."""
    route: int
    seq: int
    """Which message of the route: from 0, without gaps."""
    stamp_ns: int
    """The message's own time, for people; the relay draws no conclusion from it."""
    payload: bytes
    first: int
    """The forwarder that took it from a network first: ``origin``, if it came one hop."""
    hop: int = 0
    """How many relays it has passed before."""


@attrs.frozen
class Advertisement:
    """One route. ``revision`` rises when anything else in it changes, but for low and next."""

    origin: int
    epoch: int
    route: int
    control: int
    """Number of this control frame, counted over all of the forwarder's."""
    revision: int
    low: int
    """Contents below it cannot be had any more."""
    next: int
    """The number that the next content will have."""
    name: str
    """The topic to publish on. The name at the other end does not travel."""
    type: TopicType
    qos: Qos
    mode: Mode
    closed: bool = False
    """No more contents will follow."""
    definition: bytes | None = None
    """The text of the type; only for who asked."""


@attrs.frozen
class Entry:
    """A route in a digest."""

    route: int
    revision: int
    low: int
    next: int


@attrs.frozen
class Digest:
    """The routes that changed of late, or all; and a fingerprint of those not named."""

    origin: int
    epoch: int
    control: int
    age_ns: int
    """How long ago this life of the forwarder began."""
    full: bool
    """All routes are named."""
    fingerprint: int
    entries: tuple[Entry, ...]
    asker: int = 0
    """The republisher whose hello this answers; 0 if nobody asked."""
    hello: int = 0
    """The number of that hello."""


@attrs.frozen
class Range:
    """``count`` contents of a route, from ``start`` on."""

    route: int
    start: int
    count: int


@attrs.frozen
class Reset:
    """A republisher's questions to one life of one forwarder, or a hello to all: origin 0."""

    origin: int
    epoch: int
    asker: int
    """This life of the republisher."""
    hello: int = 0
    """Above 0: please answer with a full digest that repeats this number."""
    wanted: tuple[int, ...] = ()
    """Routes to advertise again."""
    definitions: bool = False
    """With the text of their types."""
    ranges: tuple[Range, ...] = ()
    """Contents to send again."""


Frame = Advertisement | Content | Digest | Reset
"""Whatever may travel."""


@attrs.frozen
class Malformed:
    """What came in is no frame."""

    reason: str


HEAD = struct.Struct("<BBBBQQIQqQ")
"""Version, kind, hop, flags, origin, epoch, route, seq, stamp, first: all there is of a content.

What these mean in other frames is known here only. For who has no time for more, with ``CONTENT``.
"""

CONTENT = int(Kind.CONTENT)
"""The kind; an enum's member costs a call to pack."""

KIND_AT, FLAGS_AT, ROUTE_AT = 1, 3, slice(4, 24)
"""Where a header has these bytes; a route's are its origin, its epoch and its number. For who looks
at a frame on its way."""

_ADVERT = struct.Struct("<IQQBI")
_DIGEST = struct.Struct("<QQI")
_ENTRY = struct.Struct("<IIQQ")
_RESET = struct.Struct("<HH")
_ROUTE = struct.Struct("<I")
_RANGE = struct.Struct("<IQH")
_PRINTED = struct.Struct("<IIQ")

_RELIABLE, _DURABLE, _CLOSED, _DEFINED = 1, 2, 4, 8
_FULL = 1
_DEFINITIONS = 1


def encode(frame: Frame) -> tuple[bytes, bytes]:
    """The frame as a header and a payload.

    ``struct.error`` or ``ValueError`` for numbers and names that do not fit.
    """
    match frame:
        case Content():
            numbers = (frame.origin, frame.epoch, frame.route, frame.seq)
            return content_header(*numbers, frame.stamp_ns, frame.first, frame.hop), frame.payload
        case Advertisement():
            return _advertisement(frame), frame.definition or b""
        case Digest():
            return _digest(frame), b""
    return _reset(frame), b""


def decode(header: bytes, payload: bytes) -> Frame | Malformed:
    """The frame that was written so, or why it cannot be one. Never raises."""
    try:
        return _decode(header, payload)
    except _BrokenError as broken:
        return Malformed(str(broken))


def _decode(header: bytes, payload: bytes) -> Frame:
    _must(len(header) >= HEADER_BYTES, "shorter than a header")
    version, kind, hop, flags, origin, epoch, route, seq, stamp, first = HEAD.unpack_from(header)
    _must(version == VERSION, f"version {version}; known is {VERSION}")
    if kind == CONTENT:
        _must(len(header) == HEADER_BYTES and not flags, "more than a content's header")
        return Content(origin, epoch, route, seq, stamp, payload, first, hop)
    _must(hop == 0, "only contents pass more than one relay")
    body = _Reader(header)
    if kind == Kind.ADVERTISEMENT:
        _must(stamp == first == 0, "numbers that an advertisement has not")
        return _read_advertisement(body, flags, payload, (origin, epoch, route, seq))
    _must(not payload, "a payload where there is none")
    _must(route == 0, "a route where there is none")
    if kind == Kind.DIGEST:
        return _read_digest(body, flags, (origin, epoch, seq, stamp, first))
    _must(kind == Kind.RESET, f"kind {kind} is unknown")
    _must(stamp == 0, "numbers that a reset has not")
    return _read_reset(body, flags, (origin, epoch, first, seq))


def content_header(
    origin: int, epoch: int, route: int, seq: int, stamp_ns: int, first: int, hop: int
) -> bytes:
    """What :func:`encode` writes before a content's payload, for who has no :class:`Content`."""
    return HEAD.pack(VERSION, CONTENT, hop, 0, origin, epoch, route, seq, stamp_ns, first)


def fingerprint(routes: Iterable[tuple[int, int, int]]) -> int:
    """64 bits that stand for routes, each with its revision and its next number, in their order."""
    told = b"".join(_PRINTED.pack(*route) for route in routes)
    return int.from_bytes(blake2b(told, digest_size=8).digest(), "little")


def _advertisement(one: Advertisement) -> bytes:
    qos = one.qos
    flags = (
        _RELIABLE * qos.reliable
        + _DURABLE * qos.durable
        + _CLOSED * one.closed
        + _DEFINED * (one.definition is not None)
    )
    texts = b"".join(map(_text, (one.name, one.type.name, one.type.digest)))
    return (
        HEAD.pack(
            VERSION,
            Kind.ADVERTISEMENT,
            0,
            flags,
            one.origin,
            one.epoch,
            one.route,
            one.control,
            0,
            0,
        )
        + _ADVERT.pack(one.revision, one.low, one.next, one.mode, qos.depth)
        + texts
    )


def _read_advertisement(
    body: _Reader, flags: int, payload: bytes, head: tuple[int, int, int, int]
) -> Advertisement:
    origin, epoch, route, control = head
    _must(flags < 16, "flags that are unknown")
    revision, low, after, mode, depth = body.take(_ADVERT)
    _must(mode <= max(Mode), f"mode {mode} is unknown")
    _must(low <= after, "the lowest content is above the next one")
    name, type_name, digest = body.text(), body.text(), body.text()
    _must(bool(name and type_name and digest), "no name, no type or no hash")
    body.end()
    _must(bool(flags & _DEFINED) or not payload, "a definition that is not announced")
    _must(len(payload) <= MAX_DEFINITION_BYTES, "a definition that is too long")
    return Advertisement(
        origin,
        epoch,
        route,
        control,
        revision,
        low,
        after,
        name,
        TopicType(type_name, digest),
        Qos(bool(flags & _RELIABLE), bool(flags & _DURABLE), depth),
        Mode(mode),
        bool(flags & _CLOSED),
        payload if flags & _DEFINED else None,
    )


def _digest(one: Digest) -> bytes:
    return (
        HEAD.pack(
            VERSION,
            Kind.DIGEST,
            0,
            _FULL * one.full,
            one.origin,
            one.epoch,
            0,
            one.control,
            one.age_ns,
            one.asker,
        )
        + _DIGEST.pack(one.hello, one.fingerprint, len(one.entries))
        + b"".join(_ENTRY.pack(e.route, e.revision, e.low, e.next) for e in one.entries)
    )


def _read_digest(body: _Reader, flags: int, head: tuple[int, int, int, int, int]) -> Digest:
    origin, epoch, control, age_ns, asker = head
    _must(flags <= _FULL, "flags that are unknown")
    _must(age_ns >= 0, "an age below 0")
    hello, fingerprint, count = body.take(_DIGEST)
    _must(count <= MAX_ENTRIES, "too many routes")
    entries = tuple(Entry(*body.take(_ENTRY)) for _ in range(count))
    body.end()
    _must(all(one.low <= one.next for one in entries), "the lowest content is above the next one")
    _must(_rising(one.route for one in entries), "routes out of order")
    return Digest(origin, epoch, control, age_ns, bool(flags), fingerprint, entries, asker, hello)


def _reset(one: Reset) -> bytes:
    return (
        HEAD.pack(
            VERSION,
            Kind.RESET,
            0,
            _DEFINITIONS * one.definitions,
            one.origin,
            one.epoch,
            0,
            one.hello,
            0,
            one.asker,
        )
        + _RESET.pack(len(one.wanted), len(one.ranges))
        + b"".join(map(_ROUTE.pack, one.wanted))
        + b"".join(_RANGE.pack(r.route, r.start, r.count) for r in one.ranges)
    )


def _read_reset(body: _Reader, flags: int, head: tuple[int, int, int, int]) -> Reset:
    origin, epoch, asker, hello = head
    _must(flags <= _DEFINITIONS, "flags that are unknown")
    wanted_count, range_count = body.take(_RESET)
    _must(wanted_count <= MAX_WANTED and range_count <= MAX_RANGES, "too many questions")
    wanted = tuple(body.take(_ROUTE)[0] for _ in range(wanted_count))
    ranges = tuple(Range(*body.take(_RANGE)) for _ in range(range_count))
    body.end()
    _must(all(1 <= one.count <= MAX_SPAN for one in ranges), "too many contents")
    return Reset(origin, epoch, asker, hello, wanted, bool(flags), ranges)


def _text(text: str) -> bytes:
    data = text.encode()
    return bytes([len(data)]) + data


def _rising(numbers: Iterable[int]) -> bool:
    last = -1
    for number in numbers:
        if number <= last:
            return False
        last = number
    return True


def _must(right: bool, otherwise: str) -> None:  # noqa: FBT001 - it is what the function is about
    if not right:
        raise _BrokenError(otherwise)


class _BrokenError(Exception):
    """Never leaves this module."""


class _Reader:
    """Reads what follows the header, and never beyond its end."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = HEADER_BYTES

    def take(self, what: struct.Struct) -> tuple[int, ...]:
        _must(self._at + what.size <= len(self._data), "cut short")
        taken = what.unpack_from(self._data, self._at)
        self._at += what.size
        return taken

    def text(self) -> str:
        _must(self._at < len(self._data), "cut short")
        start = self._at + 1
        self._at = start + self._data[self._at]
        _must(self._at <= len(self._data), "cut short")
        try:
            return self._data[start : self._at].decode()
        except UnicodeDecodeError:
            raise _BrokenError("a name that is no UTF-8") from None

    def end(self) -> None:
        _must(self._at == len(self._data), "more than there should be")
