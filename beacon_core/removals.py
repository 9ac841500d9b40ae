"""The ids whose records have ended, by revision, so that a reader can be told what is gone."""

from __future__ import annotations

from collections import deque
from collections.abc import Container
from itertools import takewhile

__all__ = ["Removals"]


class Removals:
    """A bounded log. Thread rule: none of its own; the store holds its lock."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._log: deque[tuple[int, str]] = deque()
        self.floor = 0
        """A reader at an earlier revision than this may have missed a removal."""

    def add(self, revision: int, entity_id: str) -> None:
        """Note that this record ended at this revision; revisions only rise."""
        self._log.append((revision, entity_id))
        if len(self._log) > self._limit:
            self.floor = self._log.popleft()[0]

    def since(self, revision: int, living: Container[str]) -> tuple[str, ...]:
        """The ids that ended after ``revision`` and are not among the living, each once."""
        ended = takewhile(lambda one: one[0] > revision, reversed(self._log))
        gone = dict.fromkeys(entity_id for _, entity_id in ended if entity_id not in living)
        return tuple(reversed(gone))
