"""The sending half of the native dialect."""

from __future__ import annotations

import secrets
import time
from collections import deque
from collections.abc import Sequence
from functools import partial

import attrs
import zenoh

from beacon_core.wire import json
from beacon_zenoh import wire
from beacon_zenoh.config import session_config
from beacon_zenoh.keys import Keys, Token
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.spokesman import Spokesman, Voice, Word

__all__ = ["ZenohAnnouncer"]

_JSON = zenoh.Encoding.APPLICATION_JSON

_MAX_QUESTIONS = 1_000
"""Not yet answered. Each takes Zenoh some memory at both ends; a flood of them is dropped."""


@attrs.define(eq=False)
class _Voice(Voice):
    """An entity that is spoken for, and what Zenoh has of it on the present session."""

    token: zenoh.LivelinessToken | None = None
    queryable: zenoh.Queryable[None] | None = None


class ZenohAnnouncer(Spokesman[_Voice]):
    """Implements :class:`beacon_core.ports.announcer.Announcer`; the thread rule is the port's."""

    def __init__(self, options: ZenohOptions, period_s: float | None = None) -> None:
        """Connects in the background. ``ConfigError`` for what Zenoh refuses, for a period that is
        not above 0, and, in the modes that listen, when that is impossible."""
        super().__init__(
            session_config(options, "client"), period_s, encode=json.encode, voice=_Voice
        )
        self._incarnation = secrets.token_hex(8)
        self._sequence = 0
        self._keys = Keys(options.prefix)
        self._questions: deque[tuple[str, zenoh.Query]] = deque()
        self._keeper.start()

    # -- in the keeper's thread ------------------------------------------------------------------

    def _begin(self, session: zenoh.Session) -> None:  # noqa: ARG002
        for voice in self._voices.values():
            voice.token = voice.queryable = None

    def _say(self, session: zenoh.Session, words: Sequence[Word]) -> None:
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

    def _envelope(self) -> bytes:
        self._sequence += 1
        return wire.encode(self._incarnation, self._sequence, time.time_ns())

    def _answer(self) -> None:
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

    def _depart(self, voice: _Voice) -> None:
        for declared in (voice.queryable, voice.token):
            if declared is not None:
                declared.undeclare()  # type: ignore[no-untyped-call]

    # -- in a receiving thread of Zenoh's --------------------------------------------------------

    def _on_question(self, entity_id: str, query: zenoh.Query) -> None:
        if len(self._questions) >= _MAX_QUESTIONS:
            query.drop()  # type: ignore[no-untyped-call]
            return
        self._questions.append((entity_id, query))
        self._keeper.wake()
