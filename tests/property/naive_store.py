"""The store's rules once more, as plainly as they can be written: for the machine to compare with.

Nothing here is fast, and nothing is remembered that could be computed: every deadline, every order
and every sum is found by looking at everything. Nothing of ``beacon_core`` is used either: hints
are plain dicts, and statuses, causes and verdicts are their names.
"""

from __future__ import annotations

from typing import Any

import attrs

__all__ = ["Entity", "NaiveStore", "Voice", "picture"]

Hint = dict[str, Any]
Step = tuple[int, str, str, str]
"""When, to which status, by which cause, with which detail."""
Picture = tuple[Any, ...]

OVERHEAD_BYTES = 750
ID_BYTES, METADATA_BYTES = 60, 130
MAX_CLAIMS = 4
MAX_FORMER_RUNS = 4
MAX_HISTORY = 16
DEPARTED = {"goodbye": "left", "lost": "lost"}
"""The verdict on a departure."""


@attrs.define(eq=False)
class Voice:
    """One who speaks under an id: what it said last, when, and as whom."""

    hint: Hint
    source: str
    incarnation: str
    number: int
    heard: int
    contending: bool = False
    departed: bool = False


@attrs.define(eq=False)
class Entity:
    holder: Voice
    status: str
    cause: str
    first_seen: int
    detail: str = ""
    others: list[Voice] = attrs.Factory(list)
    """Contenders, and predecessors that have been silent since."""
    restarts: int = 0
    history: list[Step] = attrs.Factory(list)
    runs: list[tuple[str, int]] = attrs.Factory(list)
    """Of the voices, the holder's first: each one's run, and the last number heard of it."""
    former_runs: dict[str, int] = attrs.Factory(dict)
    """Runs of which nobody is there any more; the one that went last comes last."""

    @property
    def contenders(self) -> list[Voice]:
        return [one for one in self.others if one.contending]

    @property
    def bytes(self) -> int:
        return sum(hint_bytes(one.hint) for one in [self.holder, *self.contenders])

    def look_who_has_gone(self) -> None:
        before = self.runs
        self.runs = [(one.incarnation, one.number) for one in [self.holder, *self.others]]
        for run, number in before:
            if run != "" and number > 0:
                self.former_runs[run] = max(number, self.former_runs.pop(run, 0))
        present = [run for run, _ in self.runs]
        gone = [one for one in self.former_runs.items() if one[0] not in present]
        self.former_runs = dict(gone[-MAX_FORMER_RUNS:])


def picture(entity: Entity) -> Picture:
    """All that can be seen of an entity, except when it was heard: that is no change."""
    claims = [entity.holder, *entity.contenders] if entity.contenders else []
    return (
        entity.holder.hint,
        entity.status,
        entity.cause,
        entity.detail,
        entity.first_seen,
        entity.holder.source,
        entity.holder.incarnation,
        entity.restarts,
        [(one.hint, one.source, one.incarnation) for one in claims],
        list(entity.history),
    )


class NaiveStore:
    """``ttl`` and ``expiry`` in nanoseconds. Each operation is told the time."""

    def __init__(
        self, ttl: int, expiry: int, max_hints: int, max_bytes: int, max_removed: int
    ) -> None:
        self.ttl, self.expiry = ttl, expiry
        self.max_hints, self.max_bytes, self.max_removed = max_hints, max_bytes, max_removed
        self.entities: dict[str, Entity] = {}
        self.totals = dict.fromkeys(("expired", "displaced", "refused", "restarts", "buried"), 0)
        # What changed, in the order in which it did: (revision, id), and what has ended likewise.
        self.revision = 0
        self.changed: dict[str, int] = {}
        self.removed: list[tuple[int, str]] = []
        self._seen: dict[str, Picture] = {}

    # -- what is said ----------------------------------------------------------------------------

    def hear(self, message: Voice, now: int) -> str:
        """A validated hint."""
        self.settle(now)
        message.heard = min(message.heard, now)
        entity = self.entities.get(message.hint["entity_id"])
        verdict = self._hear(entity, message, now)
        self._note()
        return verdict

    def _hear(self, entity: Entity | None, message: Voice, now: int) -> str:
        if entity is None:
            return self._begin(message, now)
        if is_numbered_later(message, entity.holder):
            message.heard = max(message.heard, entity.holder.heard)
        if 0 < message.number <= entity.former_runs.get(message.incarnation, 0):
            return "older"
        if not same_process(message, entity.holder):
            return self._hear_another(entity, message, now)
        if entity.status == "left":
            return self._hear_the_departed(entity, message, now)
        return self._hear_the_holder(entity, message, now)

    def _begin(self, message: Voice, now: int) -> str:
        if now - message.heard >= self.expiry:
            return "older"
        if not self._make_room(now, count=1, size=hint_bytes(message.hint)):
            return "store-full"
        status, cause = self._when_heard(message, now)
        entity = Entity(message, status, cause, first_seen=message.heard)
        self.entities[message.hint["entity_id"]] = entity
        return "new"

    def _hear_the_holder(self, entity: Entity, message: Voice, now: int) -> str:
        holder = entity.holder
        if is_repetition(message, holder) or message.heard < holder.heard:
            return "older"
        if entity.cause == "lost" and message.heard < entity.history[-1][0]:
            return "older"
        holder.incarnation, holder.number = run_after(holder, message)
        holder.heard = message.heard
        status, cause = self._when_heard(message, now)
        if entity.status == "stale" and status == "active":
            self._go(entity, status, cause, now)
        merged = {name: message.hint[name] or holder.hint[name] for name in holder.hint}
        if merged == holder.hint:
            return "refreshed"
        if not self._may_grow(entity, hint_bytes(merged) - hint_bytes(holder.hint), now):
            return "store-full"
        holder.hint = merged
        return "changed"

    def _hear_another(self, entity: Entity, message: Voice, now: int) -> str:
        other = first(one for one in entity.others if same_process(message, one))
        if other and is_numbered_later(message, other):
            message.heard = max(message.heard, other.heard)
        if message.heard < (other or entity.holder).heard:
            return "older"
        if other and other.departed and not is_numbered_higher(message, other):
            self.totals["buried"] += 1
            return "buried"
        if other and is_repetition(message, other):
            return "older"
        elsewhere = both_differ(message.hint["hostname"], entity.holder.hint["hostname"])
        if entity.status == "active" and (other or elsewhere):
            return self._contend(entity, other, message, now)
        # The holder has gone: that alone does not bring back who was there before it.
        proven = other is None or is_numbered_higher(message, other)
        if not proven or message.heard < entity.holder.heard:
            return "older"
        return self._take_over(entity, message, now)

    def _hear_the_departed(self, entity: Entity, message: Voice, now: int) -> str:
        gone = entity.holder
        if message.heard < gone.heard:
            return "older"
        if not is_numbered_higher(message, gone):
            self.totals["buried"] += 1
            return "buried"
        return self._take_over(entity, message, now)

    def _contend(self, entity: Entity, other: Voice | None, message: Voice, now: int) -> str:
        if other:
            message.incarnation, message.number = run_after(other, message)
        message.contending = True
        rest = [one for one in entity.others if one is not other]
        rest = [*longest_silent_first(rest)[-(MAX_CLAIMS - 2) :], message]
        contenders = [one for one in rest if one.contending]
        size = sum(hint_bytes(one.hint) for one in [entity.holder, *contenders])
        if not self._may_grow(entity, size - entity.bytes, now):
            return "store-full"
        entity.others = rest
        return "contended"

    def _take_over(self, entity: Entity, message: Voice, now: int) -> str:
        if now - message.heard >= self.expiry:
            return "older"
        status, cause = self._when_heard(message, now)
        others = [one for one in entity.others if not same_process(message, one)]
        others = longest_silent_first(others)[-(MAX_CLAIMS - 2) :]
        if not same_process(message, entity.holder):
            others += self._as_it_went(entity, now)
        contenders = [one for one in others if one.contending]
        size = sum(hint_bytes(one.hint) for one in [message, *contenders])
        if not self._may_grow(entity, size - entity.bytes, now):
            return "store-full"
        self._hand_over(entity, message, status, cause, now)
        entity.others = others
        return "changed"

    def _as_it_went(self, entity: Entity, now: int) -> list[Voice]:
        """The holder as a predecessor, if its last sign of life is not too long ago."""
        sign_of_life = entity.holder.heard
        if entity.cause in DEPARTED:
            sign_of_life = max(sign_of_life, entity.history[-1][0])
        if now - sign_of_life >= self.ttl:
            return []
        said_goodbye = entity.status == "left"
        return [attrs.evolve(entity.holder, heard=sign_of_life, departed=said_goodbye)]

    def depart(self, cause: str, speaker: Voice, now: int, detail: str = "") -> str:
        """A goodbye or a loss; the speaker's hint holds the id alone."""
        self.settle(now)
        verdict = self._depart(cause, speaker, now, detail)
        self._note()
        return verdict

    def _depart(self, cause: str, speaker: Voice, now: int, detail: str) -> str:
        entity = self.entities.get(speaker.hint["entity_id"])
        if entity is None:
            return "unknown"
        if same_process(speaker, entity.holder):
            return self._holder_departs(entity, cause, speaker, now, detail)
        other = first(one for one in entity.others if same_process(speaker, one))
        if other is None:
            return "unknown"
        if other.departed or is_repetition(speaker, other):
            return "older"
        entity.others.remove(other)
        entity.others.append(gone(other, speaker, now, said_goodbye=cause == "goodbye"))
        return DEPARTED[cause]

    def _holder_departs(
        self, entity: Entity, cause: str, speaker: Voice, now: int, detail: str
    ) -> str:
        holder = entity.holder
        if entity.status == "left" or entity.cause == cause or is_repetition(speaker, holder):
            return "older"
        holder.incarnation, holder.number = run_after(holder, speaker)
        if entity.contenders:
            self._inherit(entity, now)
            entity.others.append(gone(holder, speaker, now, said_goodbye=cause == "goodbye"))
        else:
            self._go(entity, "left" if cause == "goodbye" else "stale", cause, now, detail)
        return DEPARTED[cause]

    def forget(self, entity_id: str | None, now: int) -> int:
        self.settle(now)
        ids = [one for one in self.entities if entity_id in (None, one)]
        for one in sorted(ids, key=self.changed.__getitem__):
            self._end(one)
        return len(ids)

    # -- time ------------------------------------------------------------------------------------

    def next_deadline(self) -> int | None:
        return min((self._deadline(one) for one in self.entities.values()), default=None)

    def settle(self, now: int) -> None:
        while True:
            due = [(self._deadline(entity), name) for name, entity in self.entities.items()]
            if not due or min(due)[0] > now:
                return
            self._fall_due(*min(due))
            self._note()

    def _deadline(self, entity: Entity) -> int:
        lapses = [one.heard + self.ttl for one in entity.others]
        return min([self._end_of_status(entity), *lapses])

    def _end_of_status(self, entity: Entity) -> int:
        if entity.status == "left":
            return entity.history[-1][0] + self.ttl
        return entity.holder.heard + (self.expiry if entity.status == "stale" else self.ttl)

    def _fall_due(self, at: int, name: str) -> None:
        entity = self.entities[name]
        entity.others = [one for one in entity.others if at - one.heard < self.ttl]
        if at >= self._end_of_status(entity):
            if entity.status != "active":
                self.totals["expired"] += 1
                self._end(name)
            elif entity.contenders:
                self._inherit(entity, at)
            else:
                self._go(entity, "stale", "silent", at)

    def _when_heard(self, message: Voice, now: int) -> tuple[str, str]:
        late = now - message.heard >= self.ttl
        return ("stale", "heard-late") if late else ("active", "heard")

    # -- changes ---------------------------------------------------------------------------------

    def _go(self, entity: Entity, status: str, cause: str, at: int, detail: str = "") -> None:
        entity.status, entity.cause, entity.detail = status, cause, detail
        entity.history = [*entity.history, (at, status, cause, detail)][-MAX_HISTORY:]

    def _inherit(self, entity: Entity, at: int) -> None:
        heir = max(entity.contenders, key=lambda one: one.heard)
        others = [one for one in entity.others if one is not heir]
        self._hand_over(entity, heir, "active", "heard", at)
        entity.others = others

    def _hand_over(self, entity: Entity, heir: Voice, status: str, cause: str, at: int) -> None:
        former = entity.holder
        if not same_process(heir, former):
            entity.restarts += 1
            self.totals["restarts"] += 1
        detail = what_differs(former, heir)
        entity.holder, entity.first_seen = attrs.evolve(heir, contending=False), heir.heard
        former.contending = False
        self._go(entity, status, cause, at, detail)

    def _end(self, name: str) -> None:
        del self.entities[name]
        self._note()

    def _may_grow(self, entity: Entity, growth: int, now: int) -> bool:
        return self._make_room(now, count=0, size=growth, grower=entity)

    def _make_room(self, now: int, *, count: int, size: int, grower: Entity | None = None) -> bool:
        idle = [
            one for one in self.entities.values() if one.status != "active" and one is not grower
        ]
        idle.sort(key=worth)
        least = sum(one.bytes for one in self.entities.values() if one not in idle)
        if not self._fits(count, size, len(self.entities) - len(idle), least):
            self.totals["refused"] += 1
            return False
        while not self._fits(count, size, len(self.entities), self.bytes):
            self.totals["displaced"] += 1
            self._end(idle.pop(0).holder.hint["entity_id"])
        return True

    def _fits(self, count: int, size: int, have_count: int, have_bytes: int) -> bool:
        enough_places = count == 0 or have_count + count <= self.max_hints
        return enough_places and (size <= 0 or have_bytes + size <= self.max_bytes)

    @property
    def bytes(self) -> int:
        return sum(one.bytes for one in self.entities.values())

    # -- what a reader would be told -------------------------------------------------------------

    def _note(self) -> None:
        """Find out what has changed since the last time, by looking at everything."""
        for entity in self.entities.values():
            entity.look_who_has_gone()
        now_seen = {name: picture(entity) for name, entity in self.entities.items()}
        for name in [one for one in self._seen if one not in now_seen]:
            self.revision += 1
            del self.changed[name]
            self.removed.append((self.revision, name))
        for name, seen in now_seen.items():
            if self._seen.get(name) != seen:
                self.revision += 1
                self.changed[name] = self.revision
        self._seen = now_seen

    def changed_since(self, revision: int) -> list[str]:
        """Ids, the oldest change first."""
        later = [(when, name) for name, when in self.changed.items() if when > revision]
        return [name for _, name in sorted(later)]

    def gone_since(self, revision: int) -> set[str]:
        return {name for when, name in self.removed if when > revision} - set(self.entities)

    def too_old(self, revision: int) -> bool:
        return sum(when > revision for when, _ in self.removed) > self.max_removed


# -- who is who ----------------------------------------------------------------------------------


def same_process(one: Voice, other: Voice) -> bool:
    """The strongest evidence that both give decides."""
    if not one.source:
        return True
    if one.incarnation and other.incarnation:
        return one.incarnation == other.incarnation
    host, other_host = one.hint["hostname"], other.hint["hostname"]
    process, other_process = one.hint["process_id"], other.hint["process_id"]
    if both_differ(host, other_host) or both_differ(process, other_process):
        return False
    if host and other_host and process and other_process:
        return True
    return one.source == other.source


def both_differ(one: Any, other: Any) -> bool:
    return bool(one and other and one != other)


def is_repetition(message: Voice, known: Voice) -> bool:
    """Numbers count within one incarnation; 0 is no number."""
    if not message.incarnation or message.incarnation != known.incarnation:
        return False
    return message.number != 0 and message.number <= known.number


def is_numbered_later(message: Voice, known: Voice) -> bool:
    """A higher number of the same run was said later, whatever a clock shows."""
    same_run = message.incarnation != "" and message.incarnation == known.incarnation
    return same_run and message.number > known.number > 0


def is_numbered_higher(message: Voice, gone: Voice) -> bool:
    """Was it said after a goodbye? Also where nobody tells incarnations."""
    return message.incarnation == gone.incarnation and message.number > gone.number > 0


def gone(one: Voice, departure: Voice, now: int, *, said_goodbye: bool) -> Voice:
    incarnation, number = run_after(one, departure)
    return Voice(one.hint, one.source, incarnation, number, now, departed=said_goodbye)


def run_after(known: Voice, message: Voice) -> tuple[str, int]:
    """Its incarnation and the last number heard of that; who gives none says nothing about them."""
    if message.incarnation == known.incarnation:
        return known.incarnation, message.number or known.number
    if message.incarnation:
        return message.incarnation, message.number
    return known.incarnation, known.number


def what_differs(former: Voice, heir: Voice) -> str:
    differs = []
    if both_differ(former.incarnation, heir.incarnation):
        differs.append("incarnation")
    if both_differ(former.hint["hostname"], heir.hint["hostname"]):
        differs.append("host")
    if both_differ(former.hint["process_id"], heir.hint["process_id"]):
        differs.append("process id")
    if both_differ(former.source, heir.source):
        differs.append("source")
    if differs:
        return "another " + ", ".join(differs)
    return "the same process again" if same_process(heir, former) else "the first to claim it"


# -- small things --------------------------------------------------------------------------------


def worth(entity: Entity) -> tuple[int, int, str]:
    """Whoever comes first gives way first."""
    if entity.status == "left":
        rank = 0
    elif entity.holder.heard == entity.first_seen:
        rank = 1
    else:
        rank = 2
    return rank, entity.holder.heard, entity.holder.hint["entity_id"]


def longest_silent_first(voices: list[Voice]) -> list[Voice]:
    return sorted(voices, key=lambda one: one.heard)


def hint_bytes(hint: Hint) -> int:
    texts = [value for value in hint.values() if isinstance(value, str)]
    texts += [*hint["function_ids"], *hint["depends_on"]]
    for key, value in hint["metadata"].items():
        texts += [key, value]
    ids = len(hint["function_ids"]) + len(hint["depends_on"])
    entries = ids * ID_BYTES + len(hint["metadata"]) * METADATA_BYTES
    return OVERHEAD_BYTES + entries + sum(len(text) * bytes_per_character(text) for text in texts)


def bytes_per_character(text: str) -> int:
    """Python takes as many for each as the last one in Unicode needs."""
    last = max(map(ord, text), default=0)
    return 1 if last < 2**8 else 2 if last < 2**16 else 4


def first(voices: Any) -> Voice | None:
    return next(voices, None)
