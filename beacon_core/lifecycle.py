"""The life of a hint, as one table.

Theory. A hint is the last word of somebody who may be gone. Nothing but time, or somebody who
saw it happen, tells us that it is gone, so a hint's status is a statement about evidence:

* ACTIVE  heard within the time to live: believe it.
* STALE   not heard for ``ttl``, or the carrier saw its sender vanish: show it, with the doubt.
* LEFT    it said goodbye: it is gone on purpose. The record stays for one ``ttl`` as a tombstone,
          so that a message which was under way when the goodbye was said does not revive it.
* EXPIRED not heard for ``expiry``, or its tombstone has lapsed: it holds nothing any more, and
          whoever comes under this id next begins an empty life.

Status is a function of the evidence and the time alone: ``age >= expiry`` is EXPIRED, else
``age >= ttl`` or a loss not yet followed by a message is STALE, else ACTIVE. The store never lags
behind its clock: each of its operations first settles what has become due, in the order in which
it fell due.

CONFLICT is not a status but a flag beside it: two claimants hold one id (:mod:`.claims`).

A pair that is not in the table cannot happen; :func:`transition` raises for it, because then the
caller is wrong.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType

import attrs

__all__ = ["TRANSITIONS", "Cause", "Status", "Transition", "transition"]


class Status(enum.StrEnum):
    """What the evidence about a hint is worth; the theory is above."""

    ACTIVE = "active"
    STALE = "stale"
    LEFT = "left"
    EXPIRED = "expired"


class Cause(enum.StrEnum):
    """What moves a hint from one status to another."""

    HEARD = "heard"
    """A message younger than ``ttl`` was accepted."""
    HEARD_LATE = "heard-late"
    """A message was accepted whose stamp shows that it is already older than ``ttl``."""
    SILENT = "silent"
    """Nothing was accepted for ``ttl``."""
    LOST = "lost"
    """The carrier saw the sender vanish without a goodbye."""
    GOODBYE = "goodbye"
    """The sender said that it is going."""
    LAPSED = "lapsed"
    """Nothing was accepted for ``expiry``; or ``ttl`` has passed since the goodbye."""
    DISPLACED = "displaced"
    """It gave way to another id in a full store."""
    FORGOTTEN = "forgotten"
    """Somebody asked for it to be forgotten."""


@attrs.frozen
class Transition:
    """One step in a hint's history."""

    at_ns: int
    """On the monotonic clock: when it became true, not when it was noticed."""
    status: Status
    """The status it went to."""
    cause: Cause
    detail: str = ""
    """Such as the carrier's words about a loss."""


_A, _S, _L, _E = Status.ACTIVE, Status.STALE, Status.LEFT, Status.EXPIRED

TRANSITIONS: Mapping[tuple[Status, Cause], Status] = MappingProxyType(
    {
        # EXPIRED is also where everything begins: no record is an expired one.
        (_E, Cause.HEARD): _A,
        (_E, Cause.HEARD_LATE): _S,
        (_A, Cause.HEARD): _A,
        (_A, Cause.SILENT): _S,
        (_A, Cause.LOST): _S,
        (_A, Cause.GOODBYE): _L,
        (_A, Cause.FORGOTTEN): _E,
        (_S, Cause.HEARD): _A,
        (_S, Cause.HEARD_LATE): _S,
        (_S, Cause.LOST): _S,
        (_S, Cause.GOODBYE): _L,
        (_S, Cause.LAPSED): _E,
        (_S, Cause.DISPLACED): _E,
        (_S, Cause.FORGOTTEN): _E,
        # Only a message that proves a new life gets here; see HintStore.update.
        (_L, Cause.HEARD): _A,
        (_L, Cause.HEARD_LATE): _S,
        (_L, Cause.LAPSED): _E,
        (_L, Cause.DISPLACED): _E,
        (_L, Cause.FORGOTTEN): _E,
    }
)
"""All that can happen: from a status, by a cause, to a status. Drawn in docs/lifecycle.md."""


def transition(status: Status, cause: Cause) -> Status:
    """The status that follows; ``LookupError`` for a pair that cannot happen."""
    return TRANSITIONS[status, cause]
