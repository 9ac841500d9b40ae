"""Hypothesis strategies for whoever tests an adapter, a wire format or a store of hints.

:func:`hints` and :func:`stamps` are what honest senders say, up to and including every limit;
:func:`raw_hints` is what careless ones say; :func:`hostile_payloads` is what may come over a wire.
Needs the ``test`` extra. Hints fit ``beacon_core.limits.MAX_PAYLOAD_BYTES`` once encoded.
"""

from __future__ import annotations

import json
import string
from functools import cache
from typing import Any, TypeVar

import attrs
from hypothesis import strategies as st

from beacon_core.hint import BeaconHint
from beacon_core.limits import DEFAULT_LIMITS
from beacon_core.wire import cdr
from beacon_core.wire import json as wire_json

__all__ = ["hints", "hostile_payloads", "ids", "raw_hints", "stamps"]


def ids(max_length: int = DEFAULT_LIMITS.max_id_length) -> st.SearchStrategy[str]:
    """Valid ids: usually short ones, now and then one of ``max_length``."""
    short = st.text(_ID_ALPHABET, min_size=1, max_size=min(12, max_length))
    return _mostly(short, st.sampled_from(_ID_ALPHABET).map(lambda char: char * max_length))


def stamps() -> st.SearchStrategy[int]:
    """Stamps in nanoseconds that every wire format can carry; 0 is "not given"."""
    last = (cdr.MAX_STAMP_SEC + 1) * 10**9 - 1
    return st.just(0) | st.integers(0, last) | st.sampled_from([1, 10**9 - 1, 10**9, last])


def hints() -> st.SearchStrategy[BeaconHint]:
    """Hints that the validator accepts without a repair."""
    longest = DEFAULT_LIMITS.max_string_length
    return st.builds(
        BeaconHint,
        entity_id=ids(),
        stable_id=_NOT_GIVEN | ids(),
        display_name=_texts(longest),
        function_ids=_id_tuples(DEFAULT_LIMITS.max_function_ids),
        depends_on=_id_tuples(DEFAULT_LIMITS.max_depends_on),
        component_id=_NOT_GIVEN | ids(),
        transport_type=_texts(longest),
        negotiated_format=_texts(longest),
        process_id=st.integers(0, 2**32 - 1),
        process_name=_texts(longest),
        hostname=_texts(longest),
        metadata=_metadata(DEFAULT_LIMITS.max_metadata_entries),
    )


def raw_hints() -> st.SearchStrategy[BeaconHint]:
    """Hints of which one to all text fields break a limit or are no ids; some are about nobody.

    Each can be encoded in every wire format: only what no format can carry, such as a process id
    below 0, is left out.
    """
    return st.builds(lambda hint, broken: attrs.evolve(hint, **broken), hints(), _breaks())


def hostile_payloads() -> st.SearchStrategy[bytes]:
    """Bytes that a decoder must survive, some of which still are a hint."""
    return st.one_of(
        st.binary(max_size=600),
        _mutated(_json_payloads()),
        _mutated(_cdr_payloads()),
        _lying_words(),
        _wrong_types(),
        st.sampled_from(_HOSTILE_FIELDS).map(lambda field: b'{"entity_id":"e",' + field + b"}"),
        st.sampled_from(_HOSTILE_DOCUMENTS),
        _json_payloads().flatmap(_other_encodings),
    )


_T = TypeVar("_T")
_ID_ALPHABET = string.ascii_letters + string.digits + "_-"
_NOT_GIVEN = st.just("")
_BREAKABLE = [field.name for field in attrs.fields(BeaconHint) if field.name != "process_id"]
# Past what any Python nests or converts, and short enough for a failing example to be printed.
_DEPTH = 20_000
_DIGITS = 5_000

_HOSTILE_FIELDS = [
    b'"process_id":' + b"9" * _DIGITS,
    b'"process_id":1e999',
    b'"process_id":-1',
    b'"process_id":4294967296',
    b'"process_id":true',
    b'"process_id":NaN',
    b'"stamp":{"sec":-1,"nanosec":0}',
    b'"stamp":{"sec":Infinity,"nanosec":-Infinity}',
    b'"stamp":{"sec":' + b"9" * 40 + b',"nanosec":1}',
    b'"hostname":"a","hostname":7,"entity_id":null',
    b'"hostname":"\\ud800","metadata":{"\\udfff":"\\udc00"}',
    b'"hostname":"\xff\xfe\xed\xa0\x80\xc0\x80","metadata":{"\x80":"\xf5"}',
    b'"depends_on":' + b"[" * _DEPTH,
    b'"unknown":' + b'{"":' * (_DEPTH // 4),
    b'"function_ids":[' + b"[],0,null,{}," * 1_000 + b'""]',
    b'"metadata":{' + b",".join(b'"%d":%d' % (n, n) for n in range(1_000)) + b"}",
]
_HOSTILE_DOCUMENTS = [
    b"",
    b"null",
    b"[]",
    b'"engine_temp"',
    b"{}",
    b"{" * _DEPTH,
    b"[" * _DEPTH,
    b'{"entity_id":' + b"9" * _DIGITS + b"}",
    b'{"entity_id":"e"} {"entity_id":"f"}',
    b'\xef\xbb\xbf{"entity_id":"e"}',
    b"\0" * 4096,
    b"\0\1\0\0" + b"\xff" * 4096,
    b"\0\1\0\0" + b"\1\0\0\0\0\0\0\0" * 3 + b"\xff\xff\xff\x7f",
    b"\0\7\0\0" + b"\1\0\0\0\0\0\0\0" * 20,
]


def _mostly(usual: st.SearchStrategy[_T], rare: st.SearchStrategy[_T]) -> st.SearchStrategy[_T]:
    return usual | usual | usual | rare


def _texts(max_bytes: int) -> st.SearchStrategy[str]:
    """Text of any script; now and then one that fills its limit to the byte."""
    short = st.text(st.characters(codec="utf-8"), max_size=min(12, max_bytes // 4))
    return _mostly(short, st.sampled_from("aé温🌡").map(lambda char: _filled(char, max_bytes)))


def _filled(char: str, size: int) -> str:
    whole, rest = divmod(size, len(char.encode()))
    return char * whole + "a" * rest


def _id_tuples(cap: int) -> st.SearchStrategy[tuple[str, ...]]:
    full = tuple(f"id_{number}" for number in range(cap))
    return _mostly(st.lists(ids(), max_size=4).map(tuple), st.just(full))


def _metadata(cap: int) -> st.SearchStrategy[dict[str, str]]:
    keys = ids(DEFAULT_LIMITS.max_metadata_key_length)
    few = st.dictionaries(keys, _texts(DEFAULT_LIMITS.max_metadata_value_length), max_size=4)
    return _mostly(few, st.just({f"key_{number}": str(number) for number in range(cap)}))


@cache
def _bad_texts() -> st.SearchStrategy[str]:
    """No ids and, where not too short, no free text within its limit either."""
    any_text = st.text(st.characters(exclude_categories=()), max_size=12)
    long = st.builds(lambda char, size: char * size, st.sampled_from("aé🌡"), _SIZES)
    return any_text | st.sampled_from(["id\n", "id ", "a/b", "٣", "\ud800", "\udc00\ud800"]) | long


_SIZES = st.sampled_from([257, 513, 1025, 1_500])


@cache
def _bad_tuples() -> st.SearchStrategy[tuple[str, ...]]:
    many = st.integers(101, 300).map(lambda count: tuple(str(number) for number in range(count)))
    return many | st.just(("no id",) * 101) | st.lists(ids() | _bad_texts(), max_size=4).map(tuple)


@cache
def _bad_metadata() -> st.SearchStrategy[dict[str, str]]:
    many = st.integers(51, 200).map(lambda count: {str(number): "" for number in range(count)})
    return many | st.dictionaries(ids() | _bad_texts(), _bad_texts(), max_size=4)


@cache
def _breaks() -> st.SearchStrategy[dict[str, Any]]:
    lists = {"function_ids": _bad_tuples(), "depends_on": _bad_tuples()}
    bad: dict[str, st.SearchStrategy[Any]] = {**lists, "metadata": _bad_metadata()}
    one = [st.fixed_dictionaries({name: bad.get(name, _bad_texts())}) for name in _BREAKABLE]
    several = st.lists(st.one_of(one), min_size=2, max_size=len(one))
    return st.one_of(one) | several.map(lambda each: {k: v for d in each for k, v in d.items()})


@cache
def _json_payloads() -> st.SearchStrategy[bytes]:
    return st.builds(wire_json.encode, hints() | raw_hints(), stamps())


@cache
def _cdr_payloads() -> st.SearchStrategy[bytes]:
    return st.builds(cdr.encode, hints() | raw_hints(), stamps(), big_endian=st.booleans())


@st.composite
def _mutated(draw: st.DrawFn, payloads: st.SearchStrategy[bytes]) -> bytes:
    """A payload with one to three pieces replaced: cut out, doubled, overwritten or put in."""
    payload = draw(payloads)
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(payload)))
        end = draw(st.integers(start, min(start + 8, len(payload))) | st.just(len(payload)))
        piece = payload[start:end]
        piece = draw(st.binary(max_size=8) | st.sampled_from([b"", piece * 2, piece[::-1]]))
        payload = payload[:start] + piece + payload[end:]
    return payload


@st.composite
def _lying_words(draw: st.DrawFn) -> bytes:
    """CDR of which one length, count or number is another than the truth."""
    payload = draw(_cdr_payloads())
    at = 4 * draw(st.integers(1, len(payload) // 4 - 1))
    lie = draw(st.sampled_from([0, 1, 2**16, 2**24, 2**28, 2**31 - 1, 2**31, 2**32 - 1]))
    return payload[:at] + lie.to_bytes(4, draw(_BYTE_ORDERS)) + payload[at + 4 :]


_BYTE_ORDERS: st.SearchStrategy[Any] = st.sampled_from(["little", "big"])


def _wrong_types() -> st.SearchStrategy[bytes]:
    """Good JSON of which any field may hold anything."""
    names = st.sampled_from([*(field.name for field in attrs.fields(BeaconHint)), "stamp", "new"])
    fields = st.dictionaries(names, _json_values(), max_size=6)
    return st.builds(lambda found: json.dumps({"entity_id": "e", **found}).encode(), fields)


@cache
def _json_values() -> st.SearchStrategy[Any]:
    scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
    return st.recursive(
        scalars,
        lambda inner: (
            st.lists(inner, max_size=4)
            | st.dictionaries(st.sampled_from(["sec", "nanosec", "k", "k l"]), inner, max_size=3)
        ),
        max_leaves=8,
    )


def _other_encodings(payload: bytes) -> st.SearchStrategy[bytes]:
    encodings = st.sampled_from(["utf-16", "utf-16-be", "utf-32", "utf-8-sig", "latin-1", "utf-7"])
    return encodings.map(lambda name: payload.decode().encode(name, "replace"))
