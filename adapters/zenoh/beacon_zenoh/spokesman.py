"""What the announcers of all dialects share: whom they speak for, and whose turn it is."""

from __future__ import annotations

import heapq
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import attrs
import zenoh

from beacon_core.checks import period_ns
from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Health
from beacon_core.validator import require_id
from beacon_zenoh.config import SessionConfig
from beacon_zenoh.session import SessionKeeper

__all__ = ["Spokesman", "Voice", "Word"]

_JITTER = 0.15
"""Each wait is up to this part shorter than the period, never longer: a fleet that was switched on
together drifts apart, and nobody is late."""

_MAX_WAITING = 10_000
"""Words not yet sent. Beyond it, of each entity only the last is kept."""

Word = tuple[str, bytes | None]
"""An entity and its hint, or ``None`` for its goodbye."""


@attrs.define(eq=False)
class Voice:
    """An entity that is spoken for."""

    payload: bytes = b""
    due_ns: int = 0


_V = TypeVar("_V", bound=Voice)


class Spokesman(Generic[_V]):
    """An :class:`beacon_core.ports.announcer.Announcer` but for how a dialect says what is due.

    No method waits for the network: what is to be said is handed to a thread, and said in order.
    While there is no router, of each entity the last hint is kept, and said when there is one; a
    goodbye is not kept, because by then the hint is STALE everywhere.

    A process that ends without ``close`` vanishes: its hints become STALE, not LEFT. A child of a
    ``fork`` must make its own announcer: the parent's has no threads there, and says nothing.

    A dialect gives ``_say``, and what else it needs of ``_begin``, ``_answer`` and ``_depart``, all
    of them called in the keeper's thread, to which ``_voices`` belongs too.
    """

    def __init__(
        self,
        config: SessionConfig,
        period_s: float | None,
        *,
        encode: Callable[[BeaconHint], bytes],
        voice: Callable[[], _V],
    ) -> None:
        """Connects once ``_keeper`` is started, which is the dialect's to do.

        ``ConfigError`` for a period that is not above 0.
        """
        self._period_ns = period_ns(period_s)
        self._encode = encode
        self._new_voice = voice
        self._lock = threading.Lock()
        self._words: deque[Word] = deque()
        self._too_many = _MAX_WAITING
        self._closed = False
        # The rest belongs to the keeper's thread.
        self._voices: dict[str, _V] = {}
        self._beats: list[tuple[int, str]] = []
        self._keeper = SessionKeeper(
            config, declare=self._declare, step=self._step, farewell=self._leave
        )

    def announce(self, hint: BeaconHint) -> None:
        require_id(hint.entity_id, "announce: ")
        if self._keeper.forked:
            raise UsageError("announce: made before a fork; make an announcer in the child")
        payload = self._encode(hint)
        with self._lock:
            if self._closed:
                raise UsageError("announce: this announcer is closed; make a new one")
            self._put_in_line(hint.entity_id, payload)
        self._keeper.wake()

    def withdraw(self, entity_id: str) -> None:
        if self._keeper.forked:
            return
        with self._lock:
            if self._closed:
                return
            self._put_in_line(entity_id, None)
        self._keeper.wake()

    def close(self) -> None:
        if self._keeper.forked:
            return
        with self._lock:
            self._closed = True
        self._keeper.close()

    def health(self) -> Health:
        """How the connection is doing; never raises."""
        return self._keeper.health({"entities": len(self._voices)})

    def _say(self, session: zenoh.Session, words: Sequence[Word]) -> None:
        """Say these, in this order; ``_voices`` has who is spoken for after them."""
        raise NotImplementedError

    def _begin(self, session: zenoh.Session) -> None:
        """Make ready a new session; nothing has been said on it."""

    def _answer(self) -> None:
        """Answer who has asked meanwhile."""

    def _depart(self, voice: _V) -> None:
        """Take down what stands for a voice that has said its goodbye."""

    def _put_in_line(self, entity_id: str, payload: bytes | None) -> None:
        self._words.append((entity_id, payload))
        if len(self._words) > self._too_many:
            self._words = deque(dict(self._words).items())
            self._too_many = max(_MAX_WAITING, 2 * len(self._words))

    def _take_words(self) -> list[Word]:
        with self._lock:
            words = list(self._words)
            self._words.clear()
        return words

    # -- in the keeper's thread ------------------------------------------------------------------

    def _declare(self, session: zenoh.Session) -> None:
        self._begin(session)
        self._say(session, [(one, voice.payload) for one, voice in self._voices.items()])

    def _step(self, session: zenoh.Session | None) -> float | None:
        self._say_words(session)
        self._answer()
        return self._beat(session)

    def _leave(self, session: zenoh.Session) -> None:
        self._say_words(session)
        self._say(session, [(entity_id, None) for entity_id in self._voices])

    def _say_words(self, session: zenoh.Session | None) -> None:
        words: list[Word] = []
        departed: list[_V] = []
        # First remembered, then said: should the session end meanwhile, the next one says it.
        for entity_id, payload in self._take_words():
            voice = self._voices.pop(entity_id, None)
            if payload is not None:
                self._voices[entity_id] = voice = voice or self._new_voice()
                voice.payload = payload
                self._schedule(entity_id, voice)
            elif voice is not None:
                departed.append(voice)
            else:
                continue
            words.append((entity_id, payload))
        if session is not None:
            self._say(session, words)
            for voice in departed:
                self._depart(voice)

    def _beat(self, session: zenoh.Session | None) -> float | None:
        now_ns = time.monotonic_ns()
        due: list[Word] = []
        while self._beats and self._beats[0][0] <= now_ns:
            due_ns, entity_id = heapq.heappop(self._beats)
            voice = self._voices.get(entity_id)
            # Whoever has spoken meanwhile is due later.
            if voice is not None and voice.due_ns == due_ns:
                self._schedule(entity_id, voice)
                due.append((entity_id, voice.payload))
        if session is not None and due:
            self._say(session, due)
        return (self._beats[0][0] - now_ns) / 1e9 if self._beats else None

    def _schedule(self, entity_id: str, voice: _V) -> None:
        if self._period_ns is None:
            return
        wait_ns = self._period_ns * (1 - _JITTER * random.random())  # noqa: S311
        voice.due_ns = time.monotonic_ns() + round(wait_ns)
        heapq.heappush(self._beats, (voice.due_ns, entity_id))
        # Who speaks more often than its period leaves a void beat behind each time.
        if len(self._beats) > 2 * len(self._voices) + 100:
            self._beats = [(one.due_ns, name) for name, one in self._voices.items()]
            heapq.heapify(self._beats)
