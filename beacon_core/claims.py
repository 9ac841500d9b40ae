"""Who speaks under an id: the holder, and those who claim it too.

Theory. An id should belong to one process at a time. Processes restart, so another process under
the same id is usually its successor; and people copy configurations, so sometimes it is a second
one. The two look alike in the first message. They differ in what follows: a predecessor falls
silent, a rival speaks again. Hence:

* another process in the same place takes the id over at once, which counts as a restart; its
  predecessor is remembered for one ``ttl``. If it is heard again, both claim the id: CONFLICT;
* another *host* while the holder is ACTIVE is a rival at once: nothing restarts across machines
  within a ``ttl`` without having been stale;
* a rival's words are kept beside the holder's, never mixed into them;
* a conflict ends when one of the two has been silent for ``ttl``, has left or was lost. If that is
  the holder, the rival holds the id from then on;
* whoever said goodbye is remembered for one ``ttl``, so that what it said before, arriving late,
  does not take the id from whoever holds it now;
* a holder that has gone itself (silent, lost, left) does not bring its predecessor back. Within a
  ``ttl`` of its last sign of life a predecessor must then prove, by a higher number, that it spoke
  after it was superseded: a word without proof is more likely a late one. If it lives, that costs
  it less than a ``ttl``;
* a number of an incarnation that was heard under this id is never news again, however late it comes
  and whoever holds the id: of the latest former incarnations the last number stays known.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import attrs

from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_FORMER_RUNS, hint_bytes

__all__ = [
    "Claimant",
    "Runs",
    "Speaker",
    "claimed_bytes",
    "count_after",
    "find",
    "follows",
    "freshest_contender",
    "is_new_life",
    "last_seen",
    "noted",
    "other_host",
    "remembered",
    "repeats",
    "same_claimant",
    "seen_to_go",
    "succession",
    "told_before",
    "visible",
]

Runs = tuple[tuple[str, int], ...]
"""Incarnations, each with the last number heard of it."""


class Speaker(Protocol):
    """One who speaks under an id: a claimant, or the record of the holder."""

    hint: BeaconHint
    source: str
    incarnation: str
    sequence: int
    last_seen_ns: int


@attrs.define(eq=False)
class Claimant:
    """Somebody who speaks under an id, and its last words."""

    hint: BeaconHint
    source: str
    incarnation: str
    sequence: int
    last_seen_ns: int
    content_bytes: int = 0
    """What its hint's words take, if that has been counted; see ``validator.clean_size``."""
    contending: bool = False
    """Heard while another held the id, which is ACTIVE; otherwise a predecessor that has been
    silent since, kept for a ``ttl`` after its last sign of life."""
    departed: bool = False
    """It said goodbye, and another holds the id: a predecessor that is a tombstone."""


def same_claimant(one: Speaker, other: Speaker) -> bool:
    """Do both speak for the same process?

    The strongest evidence that both give decides: the incarnation; host and process id; at last
    the source. A message without any source makes no claim and belongs to whoever holds the id.
    """
    if not one.source:
        return True
    if one.incarnation and other.incarnation:
        return one.incarnation == other.incarnation
    said, known = one.hint, other.hint
    hosts_given = said.hostname and known.hostname
    if hosts_given and said.hostname != known.hostname:
        return False
    if said.process_id and known.process_id:
        if said.process_id != known.process_id:
            return False
        if hosts_given:
            return True
    return one.source == other.source


def other_host(one: Speaker, other: Speaker) -> bool:
    """Do both name a host, and not the same one?"""
    host, others = one.hint.hostname, other.hint.hostname
    return host != others and host != "" != others


def repeats(message: Speaker, known: Speaker) -> bool:
    """Is it a numbered message of the same incarnation, and not newer than what was heard of it?

    Without an incarnation a number says nothing: a new run would begin at 1 again.
    """
    return (
        bool(message.incarnation)
        and message.incarnation == known.incarnation
        and 0 < message.sequence <= known.sequence
    )


def count_after(known: Speaker, message: Speaker) -> tuple[str, int]:
    """The incarnation and the last number of it that are known after a message was accepted."""
    if message.incarnation == known.incarnation:
        return known.incarnation, message.sequence or known.sequence
    if message.incarnation:
        return message.incarnation, message.sequence
    return known.incarnation, known.sequence


def follows(message: Speaker, known: Speaker) -> bool:
    """Do their numbers prove that the message was sent after what was heard of its incarnation?"""
    return (
        message.sequence > known.sequence > 0
        and message.incarnation == known.incarnation
        and message.incarnation != ""
    )


def is_new_life(message: Speaker, departed: Speaker) -> bool:
    """Can the message not have been under way already when the goodbye was said?

    A higher sequence number, another incarnation, another process or another source prove it.
    """
    if not same_claimant(message, departed):
        return True
    return message.sequence > departed.sequence > 0 and message.incarnation == departed.incarnation


def find(rivals: Iterable[Claimant], speaker: Speaker) -> Claimant | None:
    """The one among the rivals for whom the speaker speaks."""
    return next((one for one in rivals if same_claimant(speaker, one)), None)


def freshest_contender(rivals: Iterable[Claimant]) -> Claimant | None:
    """Who holds the id next, if the holder is gone."""
    return max((one for one in rivals if one.contending), key=last_seen, default=None)


def visible(rivals: Iterable[Claimant]) -> list[tuple[BeaconHint, str, str]]:
    """What can be seen of rivals, but for when they were heard: who contends, and its words."""
    return [(one.hint, one.source, one.incarnation) for one in rivals if one.contending]


def claimed_bytes(rivals: Iterable[Claimant]) -> int:
    """What the words of those who contend are accounted for."""
    return sum(hint_bytes(one.hint) for one in rivals if one.contending)


def remembered(one: Speaker) -> Claimant:
    """A predecessor: who it was, without its other words, which nobody is shown."""
    hint = one.hint
    who = BeaconHint(hint.entity_id, process_id=hint.process_id, hostname=hint.hostname)
    return Claimant(who, one.source, one.incarnation, one.sequence, one.last_seen_ns)


def seen_to_go(one: Speaker, departure: Speaker, *, goodbye: bool) -> Claimant:
    """A predecessor that said goodbye or was lost, and when: what it said before is too late."""
    gone = remembered(one)
    gone.incarnation, gone.sequence = count_after(one, departure)
    gone.last_seen_ns, gone.departed = departure.last_seen_ns, goodbye
    return gone


def noted(runs: Runs, gone: Iterable[tuple[str, int]]) -> Runs:
    """``runs`` with those that have gone; the ones that went first give way."""
    known = dict(runs)
    for incarnation, number in gone:
        if incarnation and number:
            known[incarnation] = max(number, known.pop(incarnation, 0))
    return tuple(known.items())[-MAX_FORMER_RUNS:]


def told_before(message: Speaker, runs: Runs) -> bool:
    """Is it a numbered message of one of these, and not newer than what was heard of it?"""
    return any(
        message.incarnation == incarnation and 0 < message.sequence <= number
        for incarnation, number in runs
    )


def last_seen(one: Speaker) -> int:
    """A sort key."""
    return one.last_seen_ns


def succession(before: Speaker, heir: Speaker) -> str:
    """Which evidence tells the heir from the one before, in words: only what both have given."""
    pairs = {
        "incarnation": (before.incarnation, heir.incarnation),
        "host": (before.hint.hostname, heir.hint.hostname),
        "process id": (before.hint.process_id, heir.hint.process_id),
        "source": (before.source, heir.source),
    }
    changed = [name for name, (old, new) in pairs.items() if old and new and old != new]
    if changed:
        return f"another {', '.join(changed)}"
    # Two that cannot be compared in anything differ only where nobody had claimed the id.
    return "the same process again" if same_claimant(heir, before) else "the first to claim it"
