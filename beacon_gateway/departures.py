"""Who went last, and when: kept for longer than the store that heard of it keeps it.

A store forgets who left one time to live after the goodbye, and who was lost when it gives way or
expires. Another source with a longer time to live may then still believe in that entity. What is
kept here outweighs its older view; the rule is at the top of :mod:`beacon_gateway.views`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import attrs

from beacon_core.hint import BeaconHint
from beacon_core.limits import hint_bytes
from beacon_core.outcome import Outcome, Verdict
from beacon_core.ports.sink import HintSink
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint
from beacon_gateway.views import View, ended_ns

__all__ = ["MAX_DEPARTURES_BYTES", "Departures", "Witness"]

MAX_DEPARTURES_BYTES = 16 * 1024 * 1024
"""A usual one is counted as 0.9 kB: room for 10,000 that say of themselves as much again."""

_GONE = frozenset({Verdict.LEFT, Verdict.LOST})


class Departures:
    """The newest departure of each entity. Beyond a number of them, or ``MAX_DEPARTURES_BYTES``,
    the one noted first gives way.

    Thread rule: every method may be called from any thread.
    """

    def __init__(self, max_entities: int) -> None:
        """0 keeps none: with a single source there is no other view to outweigh."""
        self._max_entities = max_entities
        self._lock = threading.Lock()
        self._views: dict[str, View] = {}
        self._bytes = 0

    def note(self, view: View) -> None:
        """Somebody went, as this view says; of its words only who it was is kept."""
        view = attrs.evolve(view, stored=_in_short(view.stored))
        with self._lock:
            known = self._views.get(view.stored.entity_id)
            if known is not None and _when(known) > _when(view):
                return
            self._drop(view.stored.entity_id)
            self._views[view.stored.entity_id] = view
            self._bytes += hint_bytes(view.stored.hint)
            while len(self._views) > self._max_entities or self._bytes > MAX_DEPARTURES_BYTES:
                self._drop(next(iter(self._views)))

    def last(self, entity_id: str) -> View | None:
        """The newest departure of an entity that is still known."""
        return self._views.get(entity_id)

    def __len__(self) -> int:
        return len(self._views)

    def _drop(self, entity_id: str) -> None:
        view = self._views.pop(entity_id, None)
        if view is not None:
            self._bytes -= hint_bytes(view.stored.hint)


class Witness:
    """Stands in front of a sink, and tells of each departure after which its store shows one.

    Implements :class:`beacon_core.ports.sink.HintSink`; the thread rule is the port's.
    """

    def __init__(
        self, sink: HintSink, store: HintStore, note: Callable[[StoredHint], None]
    ) -> None:
        self._sink, self._store, self._note = sink, store, note
        # Hints go without the detour.
        self.offer = sink.offer

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        outcome = self._sink.goodbye(entity_id, source, incarnation=incarnation, sequence=sequence)
        return self._told(entity_id, outcome)

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = "connection lost"
    ) -> Outcome:
        outcome = self._sink.lost(entity_id, source, incarnation=incarnation, reason=reason)
        return self._told(entity_id, outcome)

    def _told(self, entity_id: str, outcome: Outcome) -> Outcome:
        if outcome.verdict in _GONE:
            stored = self._store.get(entity_id)
            # A rival may have gone, or another holds the id by now.
            if stored is not None and ended_ns(stored) is not None:
                self._note(stored)
        return outcome


def _when(view: View) -> int:
    return ended_ns(view.stored) or 0


def _in_short(stored: StoredHint) -> StoredHint:
    hint = stored.hint
    who = BeaconHint(
        hint.entity_id,
        display_name=hint.display_name,
        component_id=hint.component_id,
        process_id=hint.process_id,
        process_name=hint.process_name,
        hostname=hint.hostname,
    )
    return attrs.evolve(stored, hint=who, claims=(), history=stored.history[-1:])
