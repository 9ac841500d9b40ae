"""The sending half of the native dialect."""

from __future__ import annotations

import heapq
import random
import secrets
import threading
import time
from collections import deque
from functools import partial

import attrs
import zenoh

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Health
from beacon_core.validator import is_valid_id
from beacon_core.wire import json
from beacon_zenoh import wire
from beacon_zenoh.config import session_config
from beacon_zenoh.keys import Keys, Token
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.session import SessionKeeper

__all__ = ["ZenohAnnouncer"]

_JSON = zenoh.Encoding.APPLICATION_JSON

_JITTER = 0.15
"""Each wait is up to this part shorter than the period, never longer: a fleet that was switched on
together drifts apart, and nobody is late."""

_MAX_WAITING = 10_000
"""Words not yet sent. Beyond it, of each entity only the last is kept."""

_MAX_QUESTIONS = 1_000
"""Not yet answered. Each takes Zenoh some memory at both ends; a flood of them is dropped."""


_Word = tuple[str, bytes | None]
"""An entity and its hint, or ``None`` for its goodbye."""


@attrs.define(eq=False)
class _Voice:
    """An entity that is spoken for, and what Zenoh has of it on the present session."""

    payload: bytes = b""
    due_ns: int = 0
    token: zenoh.LivelinessToken | None = None
    queryable: zenoh.Queryable[None] | None = None


class ZenohAnnouncer:
    """Implements :class:`beacon_core.ports.announcer.Announcer`; the thread rule is the port's.

    No method waits for the network: what is to be said is handed to a thread, and said in order.
    While there is no router, of each entity the last hint is kept, and said when there is one; a
    goodbye is not kept, because by then the hint is STALE everywhere.

    A process that ends without ``close`` vanishes: its hints become STALE, not LEFT. A child of a
    ``fork`` must make its own announcer: the parent's has no threads there, and says nothing.
    """

    def __init__(self, options: ZenohOptions, period_s: float | None = None) -> None:
        """Connects in the background. ``ConfigError`` for what Zenoh refuses, for a period that is
        not above 0, and, in the modes that listen, when that is impossible."""
        if period_s is not None and not 0 < period_s < float("inf"):
            raise ConfigError(f"period_s: {period_s!r} cannot be used; write seconds above 0")
        self._period_ns = None if period_s is None else round(period_s * 1e9)
        self._incarnation = secrets.token_hex(8)
        self._sequence = 0
        self._keys = Keys(options.prefix)
        self._lock = threading.Lock()
        self._words: deque[_Word] = deque()
        self._too_many = _MAX_WAITING
        self._closed = False
        self._questions: deque[tuple[str, zenoh.Query]] = deque()
        # The rest belongs to the keeper's thread.
        self._voices: dict[str, _Voice] = {}
        self._beats: list[tuple[int, str]] = []
        self._keeper = SessionKeeper(
            session_config(options, "client"),
            declare=self._declare,
            step=self._step,
            farewell=self._leave,
        )
        self._keeper.start()

    def announce(self, hint: BeaconHint) -> None:
        if not is_valid_id(hint.entity_id):
            raise UsageError(
                f"announce: entity_id {hint.entity_id!r} is no id; "
                "write 1 to 256 letters, digits, '_' or '-'"
            )
        if self._keeper.forked:
            raise UsageError("announce: made before a fork; make an announcer in the child")
        payload = json.encode(hint)
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

    def _put_in_line(self, entity_id: str, payload: bytes | None) -> None:
        self._words.append((entity_id, payload))
        if len(self._words) > self._too_many:
            self._words = deque(dict(self._words).items())
            self._too_many = max(_MAX_WAITING, 2 * len(self._words))

    def _take_words(self) -> list[_Word]:
        with self._lock:
            words = list(self._words)
            self._words.clear()
        return words

    # -- in the keeper's thread ------------------------------------------------------------------

    def _step(self, session: zenoh.Session | None) -> float | None:
        self._say_words(session)
        self._answer_questions()
        return self._beat(session)

    def _leave(self, session: zenoh.Session) -> None:
        self._say_words(session)
        self._say(session, [(entity_id, None) for entity_id in self._voices])

    def _declare(self, session: zenoh.Session) -> None:
        """On a new session nothing has been said yet."""
        words: list[_Word] = []
        for entity_id, voice in self._voices.items():
            voice.token = voice.queryable = None
            words.append((entity_id, voice.payload))
        self._say(session, words)

    def _say_words(self, session: zenoh.Session | None) -> None:
        words: list[_Word] = []
        departed: list[_Voice] = []
        # First remembered, then said: should the session end meanwhile, the next one says it.
        for entity_id, payload in self._take_words():
            voice = self._voices.pop(entity_id, None)
            if payload is not None:
                self._voices[entity_id] = voice = voice or _Voice()
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
                _undeclare(voice)

    def _say(self, session: zenoh.Session, words: list[_Word]) -> None:
        """Tokens first, then hints and goodbyes in their order, then queryables: each is quick
        alone, but takes long among a thousand of another kind."""
        voices = {one: self._voices[one] for one, _ in words if one in self._voices}
        for entity_id, voice in voices.items():
            if voice.token is None:
                token = self._keys.token(Token(entity_id, self._incarnation))
                voice.token = session.liveliness().declare_token(token)
        for entity_id, payload in words:
            if payload is not None:
                self._put(session, entity_id, payload)
            else:
                session.delete(self._keys.hint(entity_id), attachment=self._envelope())
        for entity_id, voice in voices.items():
            if voice.queryable is None:
                # Its callback is direct, where all others are indirect: an indirect one has a
                # thread of its own, for each entity. This one only puts the question in line.
                callback = partial(self._on_question, entity_id)
                handler = zenoh.handlers.Callback(callback, indirect=False)
                key = self._keys.hint(entity_id)
                voice.queryable = session.declare_queryable(key, handler)

    def _put(self, session: zenoh.Session, entity_id: str, payload: bytes) -> None:
        key = self._keys.hint(entity_id)
        session.put(key, payload, encoding=_JSON, attachment=self._envelope())

    def _beat(self, session: zenoh.Session | None) -> float | None:
        now_ns = time.monotonic_ns()
        while self._beats and self._beats[0][0] <= now_ns:
            due_ns, entity_id = heapq.heappop(self._beats)
            voice = self._voices.get(entity_id)
            # Whoever has spoken meanwhile is due later.
            if voice is not None and voice.due_ns == due_ns:
                self._schedule(entity_id, voice)
                if session is not None:
                    self._put(session, entity_id, voice.payload)
        return (self._beats[0][0] - now_ns) / 1e9 if self._beats else None

    def _schedule(self, entity_id: str, voice: _Voice) -> None:
        if self._period_ns is None:
            return
        wait_ns = self._period_ns * (1 - _JITTER * random.random())  # noqa: S311
        voice.due_ns = time.monotonic_ns() + round(wait_ns)
        heapq.heappush(self._beats, (voice.due_ns, entity_id))
        # Who speaks more often than its period leaves a void beat behind each time.
        if len(self._beats) > 2 * len(self._voices) + 100:
            self._beats = [(one.due_ns, name) for name, one in self._voices.items()]
            heapq.heapify(self._beats)

    def _envelope(self) -> bytes:
        self._sequence += 1
        return wire.encode(self._incarnation, self._sequence, time.time_ns())

    def _answer_questions(self) -> None:
        while self._questions:
            entity_id, query = self._questions.popleft()
            voice = self._voices.get(entity_id)
            with query:
                if voice is not None:
                    query.reply(
                        self._keys.hint(entity_id),
                        voice.payload,
                        encoding=_JSON,
                        attachment=self._envelope(),
                    )

    # -- in a receiving thread of Zenoh's --------------------------------------------------------

    def _on_question(self, entity_id: str, query: zenoh.Query) -> None:
        if len(self._questions) >= _MAX_QUESTIONS:
            query.drop()  # type: ignore[no-untyped-call]
            return
        self._questions.append((entity_id, query))
        self._keeper.wake()


def _undeclare(voice: _Voice) -> None:
    for declared in (voice.queryable, voice.token):
        if declared is not None:
            declared.undeclare()  # type: ignore[no-untyped-call]
