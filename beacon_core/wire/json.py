"""A hint as JSON, for carriers that have no format of their own. Schema: docs/wire-formats.md.

A payload is one JSON object (RFC 8259) in UTF-8. Its keys are the names of the hint's fields, and
``stamp``; all but ``entity_id`` are optional, and ``null`` is the same as leaving the key out.
Unknown keys are ignored, so that senders may be newer than receivers. Of a key that is repeated
the last one counts.

Decoding has two roads. Most payloads are well formed, and for them anything on top of the parsing
itself is waste; so the first road looks at many fields at once and gives up at the first oddity.
The second road then starts again, field by field, and says what it found.
"""

from __future__ import annotations

import codecs
import json
from collections.abc import Mapping
from typing import Any, cast

import attrs

from beacon_core.hint import NO_METADATA, Announcement, BeaconHint
from beacon_core.limits import MAX_PROCESS_ID
from beacon_core.ports.adapter import Malformed
from beacon_core.repairs import Repairs, mended
from beacon_core.wire.common import NS, process_id_of, split_stamp, utf8

__all__ = ["MAX_STAMP_SEC", "decode", "encode"]

MAX_STAMP_SEC = (2**63 - 1) // NS - 1
"""Stamps end in the year 2262, where nanoseconds no longer fit the 64 bits other languages have."""


def encode(hint: BeaconHint, stamp_ns: int = 0) -> bytes:
    """Write a hint down: compact, only the given fields, in a fixed order, metadata in its own.

    The same hint gives the same bytes. Lone surrogates become U+FFFD. Raises
    :class:`beacon_core.errors.UsageError` for a ``process_id`` outside 0..2^32-1 and for a
    ``stamp_ns`` that is negative or past ``MAX_STAMP_SEC``. Thread rule: any thread.
    """
    process_id_of(hint)
    sec, nanosec = split_stamp(stamp_ns, MAX_STAMP_SEC)
    given: dict[str, object] = {"entity_id": hint.entity_id}
    for name in _OPTIONAL:
        if value := getattr(hint, name):
            given[name] = value
    if hint.metadata:
        given["metadata"] = dict(hint.metadata)
    if stamp_ns:
        given["stamp"] = {"sec": sec, "nanosec": nanosec}
    return utf8(_write(given))


def decode(payload: bytes) -> Announcement | Malformed:
    """Read a hint. Any bytes in, a value out: it never raises. Thread rule: any thread.

    Fields of a wrong type are cleared, text that is not UTF-8 is repaired with U+FFFD, and both
    are reported; ids and lengths are the validator's business. :class:`Malformed` is only what is
    not JSON, not an object, or about nobody.
    """
    try:
        text = payload.decode()
        found, end = _parse(text)
        if end == len(text):
            announcement = _well_formed(found, escapes="\\" in text)
            if announcement is not None:
                return announcement
    except _ODDITIES:
        pass
    return _decode_with_care(payload)


# Metadata follows them, and needs a word of its own.
_OPTIONAL = [field.name for field in attrs.fields(BeaconHint)[1:-1]]
_NO_LIST: list[str] = []
_NO_STAMP = {"sec": 0, "nanosec": 0}

# What the first road stumbles over: not JSON or not UTF-8 (both are ValueErrors), nesting, values
# that are not what they should be.
_ODDITIES = (ValueError, RecursionError, AttributeError, TypeError)


class _NotANumberError(ValueError):
    """Python's parser would take ``NaN`` and ``Infinity``; JSON does not have them."""


def _refuse_constant(name: str) -> None:
    raise _NotANumberError(name)


# Made once: json.loads builds a decoder each time it is told anything unusual, and given bytes it
# first guesses their encoding (0.65 us).
_DECODER = json.JSONDecoder(parse_constant=_refuse_constant)
_parse = _DECODER.raw_decode
_KINDS: dict[type, str] = {str: "string", list: "array", dict: "object"}
_write = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode
_join = "".join


def _well_formed(found: Any, *, escapes: bool) -> Announcement | None:
    """The announcement if nothing about it needs a second look.

    Returns ``None`` or raises one of ``_ODDITIES`` if something does.
    """
    get = found.get
    entity_id = get("entity_id")
    stable_id = get("stable_id", "")
    display_name = get("display_name", "")
    function_ids = get("function_ids", _NO_LIST)
    depends_on = get("depends_on", _NO_LIST)
    component_id = get("component_id", "")
    transport_type = get("transport_type", "")
    negotiated_format = get("negotiated_format", "")
    process_id = get("process_id", 0)
    process_name = get("process_name", "")
    hostname = get("hostname", "")
    metadata = get("metadata", NO_METADATA)
    stamp = get("stamp", _NO_STAMP)
    if not (
        type(function_ids) is type(depends_on) is list
        # bool is a subclass of int, and no number.
        and type(process_id) is int
        and 0 <= process_id <= MAX_PROCESS_ID
        and (type(metadata) is dict or metadata is NO_METADATA)
    ):
        return None
    # Joining is the cheapest way to learn that every one of them is a string.
    text = _join(
        (
            entity_id,
            stable_id,
            display_name,
            component_id,
            transport_type,
            negotiated_format,
            process_name,
            hostname,
            *function_ids,
            *depends_on,
            *metadata.values(),
        )
    )
    if escapes:
        # Only an escape can put a lone surrogate into text that was UTF-8; it has no encoding.
        _join((text, *metadata)).encode()
    stamp_ns = 0 if stamp is _NO_STAMP else _stamp_ns(stamp)
    if stamp_ns is None:
        return None
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
            metadata,
        ),
        stamp_ns,
    )


def _stamp_ns(stamp: Any) -> int | None:
    """The stamp in nanoseconds, or ``None`` if it is not a proper one."""
    if type(stamp) is not dict:
        return None
    sec, nanosec = stamp.get("sec"), stamp.get("nanosec")
    sec, nanosec = 0 if sec is None else sec, 0 if nanosec is None else nanosec
    if type(sec) is type(nanosec) is int and 0 <= sec <= MAX_STAMP_SEC and 0 <= nanosec < NS:
        return sec * NS + nanosec
    return None


def _mark(error: UnicodeError) -> tuple[str, int]:
    """Put a lone surrogate in the place of what is not UTF-8, to be found again after parsing.

    Where "replace" would put one U+FFFD, this puts one surrogate: the result is the same.
    """
    return "\udcff", cast("UnicodeDecodeError", error).end


_MARK = "beacon_core.wire.json.mark"
codecs.register_error(_MARK, _mark)


def _decode_with_care(payload: bytes) -> Announcement | Malformed:
    # Some editors and languages begin UTF-8 with a byte order mark.
    text = payload.decode("utf-8", _MARK).removeprefix("\ufeff")
    try:
        found = _DECODER.decode(text)
    except json.JSONDecodeError as error:
        return Malformed(f"$: not JSON: {error.msg} at character {error.pos}")
    except _NotANumberError as error:
        return Malformed(f"$: not JSON: {error} is not a number")
    except RecursionError:
        return Malformed("$: nested too deeply")
    except ValueError:
        # Python's guard against the quadratic cost of long integers.
        return Malformed("$: a number of thousands of digits")
    if not isinstance(found, dict):
        return Malformed(f"$: expected an object, found {_kind(found)}")
    return _Fields(found).announcement()


class _Fields:
    """Reads field by field, and notes what it had to clear, drop or mend."""

    def __init__(self, found: dict[str, Any]) -> None:
        self._found = found
        self._repairs = Repairs()

    def announcement(self) -> Announcement | Malformed:
        entity_id = self._found.get("entity_id")
        if entity_id is None:
            return Malformed("$.entity_id: missing")
        if not isinstance(entity_id, str):
            return Malformed(f"$.entity_id: expected a string, found {_kind(entity_id)}")
        hint = BeaconHint(
            entity_id=self._string("entity_id"),
            stable_id=self._string("stable_id"),
            display_name=self._string("display_name"),
            function_ids=self._strings("function_ids"),
            depends_on=self._strings("depends_on"),
            component_id=self._string("component_id"),
            transport_type=self._string("transport_type"),
            negotiated_format=self._string("negotiated_format"),
            process_id=self._process_id(),
            process_name=self._string("process_name"),
            hostname=self._string("hostname"),
            metadata=self._metadata(),
        )
        return Announcement(hint, self._stamp(), self._repairs.all())

    def _string(self, field: str) -> str:
        text = self._given(field, str, "a string")
        return "" if text is None else self._mend(text, field)

    def _strings(self, field: str) -> tuple[str, ...]:
        values = self._given(field, list, "an array of strings") or ()
        entries = (self._entry(value, field, index) for index, value in enumerate(values))
        return tuple(entry for entry in entries if entry is not None)

    def _metadata(self) -> Mapping[str, str]:
        values = self._given("metadata", dict, "an object of strings") or {}
        entries = {}
        for key, value in values.items():
            clean_key = mended(key)
            if clean_key != key:
                self._repairs.note("key not UTF-8, replaced", "metadata", clean_key)
            entry = self._entry(value, "metadata", clean_key)
            if entry is not None:
                entries[clean_key] = entry
        return entries or NO_METADATA

    def _process_id(self) -> int:
        value = self._found.get("process_id")
        if value is None:
            return 0
        # bool is a subclass of int, and no number.
        if type(value) is int and 0 <= value <= MAX_PROCESS_ID:
            return value
        self._clear("process_id", f"an integer 0..{MAX_PROCESS_ID}", value)
        return 0

    def _stamp(self) -> int:
        stamp = self._found.get("stamp")
        stamp_ns = 0 if stamp is None else _stamp_ns(stamp)
        if stamp_ns is None:
            wanted = f'{{"sec": 0..{MAX_STAMP_SEC}, "nanosec": 0..{NS - 1}}}'
            self._repairs.note(f"expected {wanted}, cleared", "stamp")
            return 0
        return stamp_ns

    def _given(self, field: str, kind: type, wanted: str) -> Any:
        value = self._found.get(field)
        if value is None or isinstance(value, kind):
            return value
        self._clear(field, wanted, value)
        return None

    def _entry(self, value: Any, field: str, part: int | str) -> str | None:
        if isinstance(value, str):
            return self._mend(value, field, part)
        if value is not None:
            done = f"expected a string, found {_kind(value)}, dropped"
            self._repairs.note(done, field, part)
        return None

    def _mend(self, text: str, field: str, part: int | str | None = None) -> str:
        clean = mended(text)
        if clean != text:
            self._repairs.note("not UTF-8, replaced", field, part)
        return clean

    def _clear(self, field: str, wanted: str, value: Any) -> None:
        self._repairs.note(f"expected {wanted}, found {_kind(value)}, cleared", field)


def _kind(value: Any) -> str:
    """What JSON calls it; a number as itself, unless it is too long to show."""
    if isinstance(value, bool):
        return "boolean"
    if isinstance(value, int | float):
        return str(value) if abs(value) < 10**18 else "a huge number"
    return _KINDS.get(type(value), "null")
