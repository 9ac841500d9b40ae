"""Whose messages these are: publishers that were heard, tied to the tokens that stand for them.

Theory. A message brings its publisher's GID, and a token tells of a publisher that is there; when
the token goes, what the publisher spoke for is lost. Which token is whose?

* rmw_zenoh derives the GID from the token's key, so there equality decides (*by number*);
* others (zenoh-ros2-sdk) take a random GID. But their sessions stamp messages, as rmw_zenoh's do,
  and with the stamp stands which session it was. Of the tokens on the messages' very key that
  belong to nobody yet, those of that session are left over; if there are none (the router stamped,
  or nobody did), all of them are. If one is left over, it must be this publisher's (*by
  elimination*). It is looked at ``SETTLE_NS`` after the first message, since tokens and messages
  are reported in different threads, and again when another token comes. A tie by number outdoes
  one by elimination.
* if several tokens are left over, none is given to anybody: a guess would make the hints of
  somebody who is there stale. But when the last of them has gone, all who may have owned one are
  lost; until then they fall back on their time to live.

Two tokens under one GID do not exist: a key has its session and its number in it.
"""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable

import attrs

from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.tokens import Member

__all__ = ["MAX_PUBLISHERS", "MAX_SPOKEN_FOR", "SETTLE_NS", "Heard", "Publishers"]

SETTLE_NS = 100_000_000
"""Ten times what separates a token from a message that was sent after it."""

MAX_PUBLISHERS = 20_000
"""Twice the hints a store keeps. Beyond it, the longest lost are forgotten first."""

MAX_SPOKEN_FOR = 100_000
"""Entities remembered, over all publishers; each takes about 100 bytes."""


@attrs.define(eq=False)
class Heard:
    """A publisher that was heard."""

    name: str
    """Its GID in hexadecimal: what a sink is told as source, and as incarnation."""
    topic_key: str
    """The key that its messages have."""
    zid: str = ""
    """The session that stamped them; ``""`` if none did."""
    entities: dict[str, int] = attrs.field(factory=dict)
    """Whom it spoke for and did not say goodbye for, and the number of its last word of each."""
    numbers: dict[int, str] = attrs.field(factory=dict)
    """The same the other way round."""
    missed: set[str] = attrs.field(factory=set)
    """Of these, whom it was not heard of since it was lost."""
    token: bytes | None = None
    """The GID of the token that it is tied to."""
    candidates: set[bytes] = attrs.field(factory=set)
    """The tokens of which one may be its own, as there are several."""
    allowed: bool = True
    """May it be listened to?"""


class Publishers:
    """Thread rule: any method from any thread; none blocks or calls back."""

    def __init__(self, admits: Callable[[Member], bool] | None = None) -> None:
        """``admits``: whom to listen to, by their tokens; then nobody without a token is heard."""
        self.heard: dict[bytes, Heard] = {}
        """By GID. To be looked at without the lock."""
        self.refused = 0
        """Publishers and entities that there was no room for: they are heard, but not missed."""
        self._admits = admits
        self._lock = threading.Lock()
        self._tokens: dict[bytes, Member] = {}
        self._owner: dict[bytes, bytes] = {}  # token's GID -> publisher's GID
        self._left_over: defaultdict[str, set[bytes]] = defaultdict(set)  # tokens, by topic key
        self._untied: dict[bytes, int] = {}  # publisher's GID -> when to look for its token
        self._spoken_for = 0

    def __len__(self) -> int:
        """How many have a token."""
        return len(self._tokens)

    def __contains__(self, token: bytes) -> bool:
        """Has somebody the token with this GID?"""
        return token in self._tokens

    def member(self, token: bytes) -> Member | None:
        """Who has the token with this GID."""
        return self._tokens.get(token)

    def listed(self, token: bytes, member: Member, now_ns: int) -> None:
        """A publisher's token came."""
        with self._lock:
            topic_key = data_key(member.data_key)
            self._tokens[token] = member
            if token not in self._owner:
                self._left_over[topic_key].add(token)
            if token in self.heard:
                self._tie(token, token)
            for gid, due_ns in self._untied.items():
                if due_ns == _NEVER and self.heard[gid].topic_key == topic_key:
                    self._untied[gid] = now_ns + SETTLE_NS

    def unlisted(self, token: bytes) -> list[Heard]:
        """A publisher's token went. Returns who has gone with it."""
        with self._lock:
            member = self._tokens.pop(token, None)
            if member is None:
                return []
            topic_key = data_key(member.data_key)
            owner = self._owner.get(token)
            if owner is not None:
                self._untie(owner, token)
            self._left_over[topic_key].discard(token)
            if not self._left_over[topic_key]:
                del self._left_over[topic_key]
            gone = [owner] if owner is not None else self._without(token)
            return [self.heard[gid] for gid in gone]

    def meet(self, gid: bytes, topic_key: str, zid: str, now_ns: int) -> Heard:
        """The publisher with this GID, which is not in ``heard`` yet, or was not a moment ago.

        ``zid``: the session that stamped its message, ``""`` if none did.
        """
        with self._lock:
            found = self.heard.get(gid)
            if found is not None:
                return found
            found = Heard(gid.hex(), topic_key, zid, allowed=self._admits is None)
            if len(self.heard) >= MAX_PUBLISHERS and not self._forget_one():
                self.refused += 1
                return found
            self.heard[gid] = found
            if gid in self._tokens:
                self._tie(gid, gid)
            else:
                self._untied[gid] = now_ns + SETTLE_NS
            return found

    def spoke(self, publisher: Heard, entity_id: str, sequence: int) -> None:
        """It was heard to speak for this entity."""
        publisher.missed.discard(entity_id)
        before = publisher.entities.get(entity_id)
        if before is None:
            with self._lock:
                if self._spoken_for >= MAX_SPOKEN_FOR:
                    self.refused += 1
                    return
                self._spoken_for += 1
        else:
            publisher.numbers.pop(before, None)
        publisher.entities[entity_id] = sequence
        publisher.numbers[sequence] = entity_id

    def left(self, publisher: Heard, entity_id: str) -> None:
        """It said goodbye for this entity."""
        publisher.missed.discard(entity_id)
        sequence = publisher.entities.pop(entity_id, None)
        if sequence is not None:
            publisher.numbers.pop(sequence, None)
            with self._lock:
                self._spoken_for -= 1

    def settle(self, now_ns: int) -> None:
        """Look for the tokens of those who have none, where that is due."""
        with self._lock:
            for gid in [gid for gid, due_ns in self._untied.items() if due_ns <= now_ns]:
                self._untied[gid] = _NEVER
                publisher = self.heard[gid]
                left_over = self._candidates(publisher)
                if len(left_over) == 1:
                    self._tie(next(iter(left_over)), gid)
                else:
                    publisher.candidates = left_over

    def next_due_ns(self) -> int | None:
        """When :meth:`settle` may have something to do."""
        with self._lock:
            soonest = min(self._untied.values(), default=_NEVER)
        return None if soonest == _NEVER else soonest

    def _tie(self, token: bytes, gid: bytes) -> None:
        publisher = self.heard[gid]
        if publisher.token is not None:
            self._untie(gid, publisher.token)
        if token in self._owner:
            self._untie(self._owner[token], token)
        for one in self._untied:
            self.heard[one].candidates.discard(token)
        self._owner[token] = gid
        self._left_over[publisher.topic_key].discard(token)
        self._untied.pop(gid, None)
        publisher.token, publisher.candidates = token, set()
        publisher.allowed = self._admits is None or self._admits(self._tokens[token])

    def _untie(self, gid: bytes, token: bytes) -> None:
        publisher = self.heard[gid]
        publisher.token = None
        self._untied[gid] = _NEVER
        del self._owner[token]
        self._left_over[publisher.topic_key].add(token)

    def _candidates(self, publisher: Heard) -> set[bytes]:
        """The tokens of which one may be this publisher's."""
        left_over = self._left_over.get(publisher.topic_key, set())
        of_session = {one for one in left_over if self._tokens[one].zid == publisher.zid}
        return of_session or set(left_over)

    def _without(self, token: bytes) -> list[bytes]:
        """Of those without a token, who may have owned this one, and no other that is there."""
        gone = []
        for gid in self._untied:
            candidates = self.heard[gid].candidates
            if token in candidates:
                candidates.discard(token)
                if not candidates:
                    gone.append(gid)
        return gone

    def _forget_one(self) -> bool:
        """Make room: the first of those whose every entity is missed, or who have none."""
        for gid in self._untied:
            publisher = self.heard[gid]
            if len(publisher.missed) == len(publisher.entities):
                self._spoken_for -= len(publisher.entities)
                del self.heard[gid], self._untied[gid]
                return True
        return False


_NEVER = 2**63
