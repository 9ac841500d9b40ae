"""Texts that many hints have in common, held once.

A fleet says the same words over and over: host names, formats, function ids, metadata keys. Each
message brings them as new objects; kept as they come, they would be half of a hint's memory
(measured: bench/store.py, 1,795 bytes per hint without, 916 with).
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import TypeVar

from beacon_core.hint import BeaconHint

__all__ = ["Pool"]

_LONGEST = 128
"""Characters, or entries of a list, beyond which nobody else is likely to say the same."""

_T = TypeVar("_T", bound=Hashable)


class Pool:
    """When it is full it is emptied, and fills again with what is said now.

    Thread rule: none of its own; the store holds its lock.
    """

    def __init__(self, max_entries: int) -> None:
        self._max_entries = max_entries
        self._held: dict[Hashable, Hashable] = {}

    def share(self, hint: BeaconHint) -> BeaconHint:
        """An equal hint that shares its texts with others."""
        if len(self._held) >= self._max_entries:
            self._held.clear()
        one, several = self._one, self._several
        return BeaconHint(
            hint.entity_id,
            hint.stable_id,
            hint.display_name,
            several(hint.function_ids),
            several(hint.depends_on),
            one(hint.component_id),
            one(hint.transport_type),
            one(hint.negotiated_format),
            hint.process_id,
            one(hint.process_name),
            one(hint.hostname),
            {one(key): one(value) for key, value in hint.metadata.items()} or hint.metadata,
        )

    def _one(self, text: str) -> str:
        return text if len(text) > _LONGEST else self._held_once(text)

    def _several(self, ids: tuple[str, ...]) -> tuple[str, ...]:
        if len(ids) > _LONGEST:
            return ids
        return self._held_once(tuple(map(self._one, ids)))

    def _held_once(self, value: _T) -> _T:
        return self._held.setdefault(value, value)  # type: ignore[return-value]
