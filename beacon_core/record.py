"""One entity in the store: a mutable record, and the immutable views of it that are given out."""

from __future__ import annotations

from operator import attrgetter

import attrs

from beacon_core.claims import Claimant, Runs, Speaker
from beacon_core.deadlines import NEVER
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status, Transition
from beacon_core.limits import MAX_HISTORY, hint_bytes
from beacon_core.stored import Claim, StoredHint

__all__ = ["Record", "merge"]


class Record:
    """Thread rule: touched under the store's lock only.

    The constructor is written out, and the fields are slots, because there are as many of these
    as there are entities.
    """

    __slots__ = (
        "cause",
        "detail",
        "due_ns",
        "first_seen_ns",
        "hint",
        "history",
        "incarnation",
        "last_seen_ns",
        "restarts",
        "revision",
        "rivals",
        "runs",
        "sequence",
        "size",
        "slot",
        "slot_end_ns",
        "source",
        "status",
        "view",
    )

    def __init__(self, first: Claimant, status: Status, cause: Cause) -> None:
        self.hint = first.hint
        self.source = first.source
        self.incarnation = first.incarnation
        self.sequence = first.sequence
        self.last_seen_ns = self.first_seen_ns = first.last_seen_ns
        self.status = status
        self.cause = cause
        self.detail = ""
        self.history: tuple[Transition, ...] = ()
        self.rivals: tuple[Claimant, ...] = ()
        self.runs: Runs = ()
        """Former incarnations: of those that still speak, or are among the rivals, nothing."""
        self.restarts = 0
        self.size = hint_bytes(first.hint, first.content_bytes)
        self.revision = 0
        """The store's revision at the last change; 0 once the record has ended."""
        self.due_ns = self.slot = self.slot_end_ns = NEVER
        self.view: StoredHint | None = None
        """The latest view; still true unless it was dropped or ``last_seen_ns`` has moved on."""

    @property
    def entity_id(self) -> str:
        return self.hint.entity_id

    @property
    def heard_once(self) -> bool:
        """Nothing has followed the first message of this life."""
        return self.last_seen_ns == self.first_seen_ns

    def remember(self, transition: Transition) -> None:
        """Put a transition into the history; the oldest gives way."""
        self.history = (*self.history, transition)[-MAX_HISTORY:]

    def given_out(self) -> StoredHint:
        """The view of this record as it is now."""
        if self.view is None or self.view.last_seen_ns != self.last_seen_ns:
            self.view = StoredHint(
                hint=self.hint,
                status=self.status,
                cause=self.cause,
                detail=self.detail,
                last_seen_ns=self.last_seen_ns,
                first_seen_ns=self.first_seen_ns,
                source=self.source,
                incarnation=self.incarnation,
                revision=self.revision,
                restarts=self.restarts,
                claims=self._claims(),
                history=self.history,
            )
        return self.view

    def _claims(self) -> tuple[Claim, ...]:
        contenders = [rival for rival in self.rivals if rival.contending]
        if not contenders:
            return ()
        speakers: tuple[Speaker, ...] = (self, *contenders)
        return tuple(
            Claim(one.hint, one.source, one.incarnation, one.last_seen_ns) for one in speakers
        )


def merge(old: BeaconHint, new: BeaconHint) -> BeaconHint:
    """``old`` with the given fields of ``new``; ``old`` itself if that changes nothing."""
    before, after = _fields_of(old), _fields_of(new)
    if after == before:
        return old
    if all(after):
        return new
    merged = [given or kept for given, kept in zip(after, before, strict=True)]
    return old if (*merged,) == before else BeaconHint(*merged)


_fields_of = attrgetter(*(field.name for field in attrs.fields(BeaconHint)))
