"""One publisher as the relay's core knows it: for ROS a publisher for each mark, of one topic.

Theory. Whose messages these are stands beside each of them, as the GID of the publisher whose token
has the mark in its node's name. So what has another mark goes out by the same publisher of Zenoh,
in order with the rest, and only the tokens differ.

What a transient-local publisher keeps for who comes later is kept here, not by Zenoh: so it
outlives the session, and is of all marks together. It is asked for and answered as rmw_zenoh does
it. A message keeps the stamp for Zenoh that it had when it was said: by that a subscription knows
what it is told a second time, and in what order. Zenoh's own stamps name the session, and what has
different names is not put in order; so these are ours. While there is no session, it waits to be
said on the next one; what is not kept is lost then, as there is nobody to hear it.
"""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import attrs
import zenoh
from zenoh.handlers import Callback

from beacon_core.relay.effects import CreatePublisher, Publish
from beacon_core.relay.marks import Mark
from beacon_zenoh.config import reason
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.keys import at_most, kept_key
from beacon_zenoh.rmw_relay.station import Part, Station

__all__ = ["Offer"]

_log = logging.getLogger(__name__)

_SECOND_NS = 1_000_000_000


@attrs.define(eq=False)
class _Voice:
    """A publisher, for ROS."""

    part: Part
    sequence: int = 0


@attrs.frozen
class _Said:
    payload: bytes
    mark: Mark
    sequence: int
    stamp_ns: int
    stamp: zenoh.Timestamp


@attrs.define
class _Clock:
    """Stamps that grow, under one name."""

    name: bytes = attrs.field(factory=lambda: secrets.token_bytes(16))
    last_ns: int = 0

    def stamp(self) -> zenoh.Timestamp:
        self.last_ns = max(time.time_ns(), self.last_ns + 1)
        return zenoh.Timestamp(zenoh.NTP64(*divmod(self.last_ns, _SECOND_NS)), self.name)


@attrs.frozen
class _Stage:
    """What there is of it on one session."""

    station: Station
    publisher: zenoh.Publisher
    queryable: zenoh.Queryable[None] | None
    tokens: list[zenoh.LivelinessToken]


class Offer:
    """Thread rule: any thread; after ``close`` nothing is said any more."""

    def __init__(
        self,
        what: CreatePublisher,
        on_question: Callable[[Offer, zenoh.Query], object],
        on_match: Callable[[object], object],
    ) -> None:
        """Both are called in receiving threads of Zenoh's. A question is to be given to
        :meth:`answer` in another one."""
        self.what = what
        self.told: tuple[int, int] | None = None
        """What the watcher was told last of whom it has matched."""
        self._on_question, self._on_match = on_question, on_match
        self._lock = threading.Lock()
        self._stage: _Stage | None = None
        self._main: Mark = (what.first, 1)
        self._voices: dict[Mark, _Voice] = {}
        depth = what.qos.depth if what.qos.durable else 0
        self._clock = _Clock()
        self._kept: deque[_Said] = deque(maxlen=depth)
        self._unsaid: deque[Publish] = deque(maxlen=depth)

    def open(self, station: Station) -> None:
        """Speak on this session; an earlier one is about to be closed. Raises ``ZError``."""
        with self._lock:
            before = {self._main: 0} | {
                mark: voice.sequence for mark, voice in self._voices.items()
            }
            self._voices = {}
            for mark, sequence in before.items():
                part = station.publisher(mark, self.what)
                if part is not None:
                    self._voices[mark] = _Voice(part, sequence)
            self._stage = self._set(station, self._voices[self._main].part)
            unsaid = list(self._unsaid)
            self._unsaid.clear()
            for one in unsaid:
                self._say(one)

    def publish(self, what: Publish) -> None:
        """Say it, or keep it for later, or lose it."""
        with self._lock:
            self._say(what)

    def heard(self) -> bool:
        """Does Zenoh know somebody who listens?"""
        stage = self._stage
        if stage is None:
            return False
        status: Any = stage.publisher.matching_status  # its stub has another type
        return bool(status.matching)

    def answer(self, query: zenoh.Query) -> None:
        """Say what is kept again, with the numbers and stamps that it had. Raises ``ZError``."""
        with self._lock:
            kept = list(self._kept)[-at_most(query.parameters.get("_max")) :]
            voices = dict(self._voices)
        for one in kept:
            part = voices.get(one.mark, voices[self._main]).part
            beside = attachment.encode(part.gid, one.sequence, one.stamp_ns)
            query.reply(part.key, one.payload, attachment=beside, timestamp=one.stamp)

    def close(self) -> None:
        """End it. What was said goes out."""
        with self._lock:
            stage, self._stage = self._stage, None
            if stage is None:
                return
            for voice in self._voices.values():
                stage.station.end(voice.part)
            for token in stage.tokens:
                token.undeclare()  # type: ignore[no-untyped-call]
            if stage.queryable is not None:
                stage.queryable.undeclare()  # type: ignore[no-untyped-call]
            stage.publisher.undeclare()  # type: ignore[no-untyped-call]

    def _set(self, station: Station, main: Part) -> _Stage:
        session = station.session
        publisher = session.declare_publisher(
            main.key,
            # As rmw_zenoh does. To wait could hold up everybody, and end the connection after 5 s.
            congestion_control=zenoh.CongestionControl.DROP,
            reliability=zenoh.Reliability.RELIABLE
            if self.what.qos.reliable
            else zenoh.Reliability.BEST_EFFORT,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        matching: Callback[zenoh.MatchingStatus] = Callback(self._on_match, indirect=False)
        publisher.declare_matching_listener(matching)
        if not self.what.qos.durable:
            return _Stage(station, publisher, None, [])
        kept = kept_key(main.key, main.member.zid, main.member.member_id)
        handler = Callback(partial(self._on_question, self), indirect=False)
        queryable = session.declare_queryable(kept, handler)
        return _Stage(station, publisher, queryable, [session.liveliness().declare_token(kept)])

    def _say(self, what: Publish) -> None:
        stage = self._stage
        if stage is None:
            self._unsaid.append(what)
            return
        try:
            self._put(stage, what)
        except zenoh.ZError as error:  # its session was closed meanwhile
            _log.debug("%s: a message was not sent: %s", self.what.topic, reason(error))
            self._stage = None
            self._unsaid.append(what)

    def _put(self, stage: _Stage, what: Publish) -> None:
        mark, voice = self._voice(stage.station, (what.first, what.hop))
        stamp_ns = what.stamp_ns if what.stamp_ns > 0 else time.time_ns()
        beside = attachment.encode(voice.part.gid, voice.sequence + 1, stamp_ns)
        stamp = self._clock.stamp() if self.what.qos.durable else None
        stage.publisher.put(what.payload, attachment=beside, timestamp=stamp)
        voice.sequence += 1
        if stamp is not None:
            self._kept.append(_Said(what.payload, mark, voice.sequence, stamp_ns, stamp))

    def _voice(self, station: Station, mark: Mark) -> tuple[Mark, _Voice]:
        """That of the mark, or if there are too many of the route."""
        voice = self._voices.get(mark)
        if voice is None and (part := station.publisher(mark, self.what)) is not None:
            voice = self._voices[mark] = _Voice(part)
        if voice is None:
            mark, voice = self._main, self._voices[self._main]
        return mark, voice
