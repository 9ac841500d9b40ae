"""The topics of a domain, as they follow from its tokens: who publishes them, and who listens.

Our own publishers and subscriptions, a conduit's, and what services and actions are made of, are
none: a relay of topics alone would break the last.
"""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable

import attrs

from beacon_core.relay.marks import Mark, is_conduit, mark_of
from beacon_core.relay.values import Qos, TopicType
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of
from beacon_zenoh.rmw_relay.merging import reaches

__all__ = ["Topics"]

_INFRASTRUCTURE = ("/_action/", "/_service_event")

_NAMED_WITHIN_S = 0.1
"""A token comes some milliseconds before or after the first message of its publisher."""
_PATIENT_AGAIN_S = 1.0
"""Whose number is none of a token's is waited for in vain; a flood of them must cost little."""
_MAX_TOKENLESS = 10_000
"""Publishers that are remembered though they have no token."""


@attrs.define
class _Topic:
    publishers: dict[str, Member] = attrs.field(factory=dict)
    subscriptions: dict[str, Member] = attrs.field(factory=dict)

    def of(self, kind: Kind) -> dict[str, Member]:
        return self.publishers if kind is Kind.PUBLISHER else self.subscriptions


class Topics:
    """Implements :class:`beacon_zenoh.rmw.watch.Watcher`. Thread rule: any thread; only ``mark``
    may wait, for 0.1 s."""

    def __init__(self, is_ours: Callable[[Member], bool], news: Callable[[], object]) -> None:
        """``is_ours``: is it of one of our own sessions? ``news``: called when there are some."""
        self._is_ours, self._news = is_ours, news
        self._changed = threading.Condition()
        self._topics: defaultdict[str, _Topic] = defaultdict(_Topic)
        self._marks: dict[bytes, Mark] = {}
        self._dirty: set[str] = set()
        # Of those who have gone, whose last messages may be under way; and who never had a token.
        self._tokenless: dict[bytes, Mark] = {}
        self._patient_at_s = 0.0

    def came(self, key: str, member: Member, now_ns: int) -> None:  # noqa: ARG002 - the watch's
        """As the watch wants it."""
        if not self._concerns_us(member):
            return
        with self._changed:
            self._topics[member.name].of(member.kind)[key] = member
            if member.kind is Kind.PUBLISHER:
                self._marks[gid_of(key)] = mark_of(member.node_name)
                self._changed.notify_all()
            self._dirty.add(member.name)
        self._news()

    def came_again(self, key: str, now_ns: int) -> None:
        """The same. It is no news."""

    def went(self, key: str, member: Member, now_ns: int) -> None:  # noqa: ARG002 - the watch's
        """The same."""
        if not self._concerns_us(member):
            return
        with self._changed:
            self._topics[member.name].of(member.kind).pop(key, None)
            mark = self._marks.pop(gid := gid_of(key), None)
            if mark is not None:
                self._remember(gid, mark)
            self._dirty.add(member.name)
        self._news()

    def changed(self) -> dict[str, list[Member]]:
        """The topics of which somebody has come or gone since the last call, with those who publish
        them now."""
        with self._changed:
            dirty, self._dirty = self._dirty, set()
            found = {name: list(self._topics[name].publishers.values()) for name in dirty}
            for name in dirty:
                if not self._topics[name].publishers and not self._topics[name].subscriptions:
                    del self._topics[name]
        return found

    def could_have(self, topic: str, of: TopicType, qos: Qos) -> int:
        """How many subscriptions a publisher of ours can reach."""
        with self._changed:
            known = self._topics.get(topic)
            ends = [] if known is None else list(known.subscriptions.values())
        return sum(reaches(qos, of, one) for one in ends)

    def mark(self, gid: bytes) -> Mark:
        """What the publisher with this number says of its messages.

        Waits for the token of one that is new. ``(0, 0)`` if it is no relay's, or none comes.
        """
        found = self._marks.get(gid) or self._tokenless.get(gid)
        if found is not None:
            return found
        with self._changed:
            if time.monotonic() >= self._patient_at_s:
                self._changed.wait_for(lambda: gid in self._marks, _NAMED_WITHIN_S)
            if gid not in self._marks:
                self._patient_at_s = time.monotonic() + _PATIENT_AGAIN_S
                self._remember(gid, (0, 0))
            return self._marks.get(gid, (0, 0))

    def _remember(self, gid: bytes, mark: Mark) -> None:
        self._tokenless[gid] = mark
        if len(self._tokenless) > _MAX_TOKENLESS:
            del self._tokenless[next(iter(self._tokenless))]

    def _concerns_us(self, member: Member) -> bool:
        return (
            member.kind in _ENDS
            and not any(part in member.name for part in _INFRASTRUCTURE)
            and not is_conduit(member.node_name)
            and not self._is_ours(member)
        )


_ENDS = (Kind.PUBLISHER, Kind.SUBSCRIBER)
