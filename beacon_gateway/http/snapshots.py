"""Answers that are kept for a moment, because many ask for the same.

What is kept is an answer as it was true at one moment, and it is given out for ``LONGEST_NS`` after
it at most: so much may every age in it be behind. No change is hidden: an answer is made anew as
soon as a store has another revision, or something in a store has fallen due, or others are known
beforehand. What may be seen a
moment late is the refresh of a hint, which changes nothing but its age.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import TypeAlias

import attrs

from beacon_gateway.gateway import Gateway

__all__ = ["LONGEST_NS", "MAX_BYTES", "Snapshots"]

LONGEST_NS = 100_000_000
"""A tenth of a second: less than a person or a poll can tell, and ten answers a second to make."""

MAX_BYTES = 32 * 1024 * 1024
"""Of all that is kept: some lists of ten thousand entities. Beyond it everything is forgotten."""

_Revisions: TypeAlias = tuple[int, ...]


@attrs.frozen
class _Kept:
    content: bytes
    revisions: _Revisions
    until_ns: int


class Snapshots:
    """Thread rule: every method may be called from any thread."""

    def __init__(self, gateway: Gateway) -> None:
        self._clock = gateway.clock
        self._directory = gateway.directory
        self._stores = [listener.store for listener in gateway.listeners]
        self._lock = threading.Lock()
        self._kept: dict[Hashable, _Kept] = {}
        self._bytes = 0

    def get(self, key: Hashable) -> bytes | None:
        """The answer, if it is kept and still good."""
        kept = self._kept.get(key)
        if kept is None or self._clock.monotonic_ns() > kept.until_ns:
            return None
        return kept.content if kept.revisions == self._revisions() else None

    def make(self, key: Hashable, make: Callable[[], bytes]) -> bytes:
        """The answer, made now; kept unless making it fails."""
        # What is true before is read before: what changes meanwhile ends it.
        revisions, until_ns = self._revisions(), self._until_ns()
        content = make()
        with self._lock:
            self._keep(key, _Kept(content, revisions, until_ns))
        return content

    def _keep(self, key: Hashable, one: _Kept) -> None:
        # Nearly always it takes the place of an older one.
        before = self._kept.pop(key, None)
        if before is not None:
            self._bytes -= len(before.content)
        if self._bytes + len(one.content) > MAX_BYTES:
            self._kept, self._bytes = {}, 0
        self._bytes += len(one.content)
        self._kept[key] = one

    def _revisions(self) -> _Revisions:
        known = self._directory.known_revision
        return (known, *[store.revision for store in self._stores])

    def _until_ns(self) -> int:
        due = [store.next_deadline_ns() for store in self._stores]
        until = [at - 1 for at in due if at is not None]
        return min([self._clock.monotonic_ns() + LONGEST_NS, *until])
