"""Inputs that somebody will send one day, by intent or by mistake."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_PAYLOAD_BYTES
from beacon_core.wire import cdr
from beacon_core.wire.medkit import GOODBYE, farewell

__all__ = ["HOSTILE_CDR", "HOSTILE_IDS", "HOSTILE_JSON", "HOSTILE_PAYLOADS", "OVERSIZE_PAYLOAD"]

HOSTILE_PAYLOADS: Mapping[str, bytes] = {
    "nothing": b"",
    "a-nul": b"\0",
    "nuls": bytes(32),
    "ones": b"\xff" * 4096,
    "every-byte": bytes(range(256)) * 4,
    "text": b"hello",
    "a-line-end": b"\n",
    "cdr-header-alone": b"\0\1\0\0",
    "cdr-endless-string": b"\0\1\0\0\xff\xff\xff\x7f",
    "json-cut-short": b'{"entity_id": "hostile", "display_na',
    "json-array": b"[]",
    "json-null": b"null",
    "json-nobody": b"{}",
    "json-deep": b"[" * 100_000,
    "json-deep-inside": b'{"entity_id": "hostile", "metadata": ' + b'{"a":' * 40_000,
    "json-many-digits": b'{"entity_id": ' + b"9" * 10_000 + b"}",
    "json-infinity": b'{"entity_id": Infinity}',
    "utf-16": '{"entity_id": "hostile"}'.encode("utf-16"),
    "xml": b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "b">]><a>&b;</a>',
    "pickle": b"cos\nsystem\n(S'true'\ntR.",
}
"""Bytes that are a hint in no wire format: each must be refused as malformed."""

HOSTILE_JSON: Mapping[str, bytes] = {
    "stamp-negative": b'{"entity_id": "hostile", "stamp": {"sec": -1, "nanosec": 0}}',
    "stamp-least": b'{"entity_id": "hostile", "stamp": {"sec": -9223372036854775808}}',
    "stamp-huge": b'{"entity_id": "hostile", "stamp": {"sec": 1e300, "nanosec": 1}}',
    "stamp-text": b'{"entity_id": "hostile", "stamp": "now"}',
    "nanosec-huge": b'{"entity_id": "hostile", "stamp": {"sec": 1, "nanosec": 9999999999}}',
    "process-id-negative": b'{"entity_id": "hostile", "process_id": -1}',
    "process-id-huge": b'{"entity_id": "hostile", "process_id": 4294967296}',
    "process-id-true": b'{"entity_id": "hostile", "process_id": true}',
    "lists-of-anything": b'{"entity_id": "hostile", "function_ids": [1, null, {}, ["a"], "ok"]}',
    "lists-as-objects": b'{"entity_id": "hostile", "depends_on": {"a": "b"}}',
    "metadata-of-anything": b'{"entity_id": "hostile", "metadata": {"a": 1, "b": null, "c": []}}',
    "metadata-as-array": b'{"entity_id": "hostile", "metadata": [["a", "b"]]}',
    "metadata-bad-keys": b'{"entity_id": "hostile", "metadata": {"": "x", "a b": "y", "k": "z"}}',
    "not-utf-8": b'{"entity_id": "hostile", "display_name": "\xff\xfe\xc3"}',
    "lone-surrogate": b'{"entity_id": "hostile", "display_name": "\\ud800"}',
    "key-twice": b'{"entity_id": "first", "entity_id": "hostile"}',
    "unknown-keys": b'{"entity_id": "hostile", "__class__": "os.system", "future": [1, 2]}',
    "wrong-types": b'{"entity_id": "hostile", "display_name": 7, "hostname": ["a"]}',
}
"""JSON hints about ``hostile``, each with something wrong: repaired, or refused; never a fault."""


def _altered(field_value: bytes, at: int) -> bytes:
    """A good message with four bytes replaced, counted from the end."""
    good = bytearray(cdr.encode(BeaconHint("hostile"), 1))
    good[len(good) + at : len(good) + at + 4] = field_value
    return bytes(good)


HOSTILE_CDR: Mapping[str, bytes] = {
    "stamp-negative": _altered(struct.pack("<i", -1), -8),
    "nanosec-huge": _altered(b"\xff\xff\xff\xff", -4),
    "metadata-endless": _altered(b"\xff\xff\xff\xff", -12),
    "big-endian": cdr.encode(BeaconHint("hostile"), big_endian=True),
    "not-utf-8": cdr.encode(BeaconHint("hostile", display_name="xyz")).replace(
        b"xyz", b"\xff\xc3z"
    ),
    "bytes-behind": cdr.encode(BeaconHint("hostile")) + b"\xde\xad\xbe\xef" * 5,
    "mark-of-a-goodbye-alone": GOODBYE,
    "goodbye-for-nobody": farewell(""),
    "goodbye-for-a-stranger": farewell("../../etc/passwd\n"),
    "goodbye-in-pieces": farewell("hostile")[:7] + GOODBYE,
}
"""The same as ROS messages: repaired, or refused; never a fault."""

HOSTILE_IDS: Mapping[str, str] = {
    "empty": "",
    "space": "a b",
    "dot-dot": "../../etc/passwd",
    "line-end": "engine\n",
    "nul": "engine\0",
    "escape": "\x1b[2Jengine",
    "digits-of-another-script": "engine\u0664",
    "letters-of-another-script": "\u0435ngine",
    "over-long": "a" * 257,
    "a-thousand-lines": "\n" * 1000,
}
"""Entity ids that are none: the hint is refused as invalid."""

OVERSIZE_PAYLOAD = b" " * MAX_PAYLOAD_BYTES + b"{}"
"""A little over the limit; refused before it is looked at."""
