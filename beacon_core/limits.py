"""Every cap in the core: which flood it stops, why this number, and who else chose it.

Lengths of texts count bytes of UTF-8, as on the wire; a store's bytes are those of memory.
"""

from __future__ import annotations

import attrs

from beacon_core.hint import BeaconHint

__all__ = [
    "DEFAULT_LIMITS",
    "HINT_OVERHEAD_BYTES",
    "LIST_ENTRY_BYTES",
    "MAX_CLAIMS",
    "MAX_FORMER_RUNS",
    "MAX_HINTS",
    "MAX_HISTORY",
    "MAX_LOG_CHARS",
    "MAX_PAYLOAD_BYTES",
    "MAX_POOLED",
    "MAX_PROCESS_ID",
    "MAX_REMEMBERED_BYTES",
    "MAX_REMOVED",
    "MAX_REPAIRS",
    "MAX_SHORTCUT_BYTES",
    "MAX_SKIPS_LOGGED",
    "MAX_SOURCES",
    "MAX_SOURCE_NAME",
    "MAX_STORE_BYTES",
    "METADATA_ENTRY_BYTES",
    "HintLimits",
    "held_bytes",
    "hint_bytes",
]


@attrs.frozen
class HintLimits:
    """The size of one hint. The defaults are those of ros2_medkit, so what it takes we take."""

    max_id_length: int = 256
    """SOVD entity ids appear in URLs; 256 is the gateway's own limit for them."""
    max_string_length: int = 512
    """Names of hosts (POSIX: 255), processes and formats; twice the longest honest one."""
    max_function_ids: int = 100
    max_depends_on: int = 100
    max_metadata_entries: int = 50
    max_metadata_key_length: int = 64
    max_metadata_value_length: int = 1024


DEFAULT_LIMITS = HintLimits()
"""What applies unless something else is asked for."""

MAX_PROCESS_ID = 2**32 - 1
"""A process id is 32 bits on the wire; Linux itself stops at 2^22."""

MAX_PAYLOAD_BYTES = 256 * 1024
"""A hint that fills every limit takes about 112,000 bytes; twice that leaves room for JSON's
escapes. More is refused unread, so a 100 MB message costs nothing but its transport."""

MAX_HINTS = 10_000
"""Entities per store. The default of ros2_medkit."""

MAX_STORE_BYTES = 64 * 1024 * 1024
"""All hints of a store together. 10,000 hints at their limits would take 1.2 GiB; an honest fleet
of 10,000 is counted as 15 MB, so this is four times what is needed."""

HINT_OVERHEAD_BYTES = 750
"""What a stored hint costs besides its text and its entries: 580 if it says nothing but its id, 950
if it fills all its single fields with words of its own (measured as test_limits.py does)."""

LIST_ENTRY_BYTES = 60
"""What an id in a list costs besides its text (measured with 200 short ones). Counted as if no two
hints had any in common, though most have: what a stranger sends need not."""

METADATA_ENTRY_BYTES = 130
"""The same for a key and its value (measured with 50 short ones)."""

MAX_CLAIMS = 4
"""Rival claims kept per entity. Two make a conflict; more tell no one anything new."""

MAX_FORMER_RUNS = 4
"""Incarnations per entity that speak no more, and the last number heard of each: what they said,
arriving late or again, is known for what it is. Nobody restarts five times while a message is under
way. Whoever invents incarnations makes the store forget those of that one id."""

MAX_HISTORY = 16
"""Transitions kept per entity: they show that a robot flaps, also when it flaps for a year."""

MAX_POOLED = 16_384
"""Texts that many hints share and that are therefore held once: 4 MB at the most."""

MAX_REMOVED = 10_000
"""Ended ids remembered for ``changes_since``. A reader further behind is given everything."""

MAX_SOURCES = 10_000
"""Sources whose rate and counters are kept apart. Beyond it the least recently heard one is folded
into the totals, strangers before settled ones, so a flood of invented names displaces itself."""

MAX_SOURCE_NAME = 256
"""Characters of a source's name, an incarnation's and a reason that count: they come from outside
and are kept."""

MAX_REMEMBERED_BYTES = 16 * 1024 * 1024
"""Payloads remembered so that an unchanged one need not be decoded: 10,000 fleet-sized hints with
room for three times as many. Beyond it payloads are simply decoded."""

MAX_SHORTCUT_BYTES = 1024
"""The largest payload that a source's account keeps at hand: 10 MB over all accounts."""

MAX_REPAIRS = 32
"""Repairs reported per hint; a hint with 10,000 bad ids is reported as 31 and "… and more"."""

MAX_SKIPS_LOGGED = 1_000
"""Unknown entities named in the log, once each, by one mapper. Whoever invents names fills no more
of the log than that, and the count of all of them is in every introspection."""

MAX_LOG_CHARS = 120
"""Foreign text in one log line, after escaping (upstream logged 2 MB for a 1 MB id)."""


def hint_bytes(hint: BeaconHint, content_bytes: int = 0) -> int:
    """What one hint is accounted for in the byte cap: about the memory it holds.

    An overhead, its text, and what each of its entries takes. ``content_bytes`` is the last two,
    where they have been counted before.
    """
    return HINT_OVERHEAD_BYTES + (content_bytes or _content_bytes(hint))


def held_bytes(text: str) -> int:
    """What a text takes in memory: each character as many bytes as the widest of them needs.

    A single emoji makes Python keep a thousand ASCII letters as four thousand bytes.
    """
    length = len(text)
    if text.isascii() or len(text.encode("latin-1", "ignore")) == length:
        return length
    # Not every hint in a store has been validated: there may be lone surrogates.
    fits_two = len(text.encode("utf-16-le", "surrogatepass")) == 2 * length
    return length * (2 if fits_two else 4)


def _content_bytes(hint: BeaconHint) -> int:
    texts = (
        hint.entity_id,
        hint.stable_id,
        hint.display_name,
        hint.component_id,
        hint.transport_type,
        hint.negotiated_format,
        hint.process_name,
        hint.hostname,
        *hint.function_ids,
        *hint.depends_on,
        *hint.metadata,
        *hint.metadata.values(),
    )
    listed = len(hint.function_ids) + len(hint.depends_on)
    entries = listed * LIST_ENTRY_BYTES + len(hint.metadata) * METADATA_ENTRY_BYTES
    together = "".join(texts)
    return entries + (len(together) if together.isascii() else sum(map(held_bytes, texts)))
