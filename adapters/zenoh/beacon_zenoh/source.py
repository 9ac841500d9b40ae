"""The receiving half of the native dialect."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from threading import get_ident

import zenoh

from beacon_core.ports.health import Health
from beacon_core.ports.sink import HintSink
from beacon_zenoh.config import session_config
from beacon_zenoh.keys import Keys, Token
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.questions import EVERYBODY, Questions
from beacon_zenoh.roster import Roster
from beacon_zenoh.session import CLOSE_WITHIN_S, SessionKeeper
from beacon_zenoh.wire import NO_ENVELOPE, decode

__all__ = ["ZenohSource"]

_log = logging.getLogger(__name__)

_ANSWER_WITHIN_S = 2.0
"""How long a question stays open: a hung announcer costs no more than its slot until then."""

_BACK_WITHIN_NS = 1_000_000_000
"""On a new session the tokens of all who are there are reported again within ms."""

_STEP_AT_LEAST_S = 0.025
"""What becomes due meanwhile is done at one go: a thousand tokens make one question."""

_PUT = zenoh.SampleKind.PUT


class ZenohSource:
    """Implements :class:`beacon_core.ports.source.HintSource`; the thread rule is the port's.

    The sink's ``source`` is the entity id in the message's key, and a payload must name the same.
    Zenoh brings no sender with a message: its ``source_info`` is absent unless the sender fills it
    in, and then says what the sender likes. The key is the one thing that access control binds to
    a certificate or a user. Without access control it is as good as any other claim.
    """

    def __init__(self, options: ZenohOptions) -> None:
        """Opens nothing. ``ConfigError`` for what Zenoh refuses."""
        self._keeper = SessionKeeper(
            session_config(options, "router"),
            declare=self._declare,
            step=self._step,
            farewell=lambda _: None,
        )
        self._keys = Keys(options.prefix)
        self._entity_of = self._keys.entity_of
        self._roster = Roster()
        self._awaited = self._roster.awaited
        self._questions = Questions(time.monotonic_ns())
        self._sink: HintSink | None = None
        self._closed = False
        # Held during each call of the sink: what makes "after close, no call" true.
        self._gate = threading.Lock()
        self._speaker = 0  # the thread that is in such a call
        self._counting = threading.Lock()
        self._counters = dict.fromkeys(("asked", "bad-attachments", "bad-keys", "sink-errors"), 0)

    def start(self, sink: HintSink) -> None:
        if self._sink is None:
            self._sink, self._offer = sink, sink.offer
        self._keeper.start()

    def close(self) -> None:
        if self._keeper.forked:
            return
        began = time.monotonic()
        inside = self._speaker == get_ident()
        # A sink that hangs must not hang us: it finds the gate shut when it is through.
        held = not inside and self._gate.acquire(timeout=CLOSE_WITHIN_S / 2)
        self._closed = True
        if held:
            self._gate.release()
        spent = time.monotonic() - began
        self._keeper.close(0.0 if inside else CLOSE_WITHIN_S - spent)

    def health(self) -> Health:
        roster = {
            "tokens": len(self._roster),
            "tokens-refused": self._roster.refused,
            "tokens-overlooked": self._roster.overlooked,
            "questions-postponed": self._questions.postponed,
        }
        return self._keeper.health({**roster, **self._counters})

    def _declare(self, session: zenoh.Session) -> None:
        self._roster.all_vanished(time.monotonic_ns() + _BACK_WITHIN_NS)
        session.declare_subscriber(self._keys.hints, self._on_hint)
        # With a callback: the default channel deadlocks on the 257th token. And never liveliness()
        # .get on this session: it leaves ghosts in it.
        session.liveliness().declare_subscriber(self._keys.tokens, self._on_token, history=True)
        self._questions.want([EVERYBODY])
        self._ask_who_waits(session, time.monotonic_ns())

    def _step(self, session: zenoh.Session | None) -> float | None:
        now_ns = time.monotonic_ns()
        due = self._roster.due(now_ns)
        for token in due.lost:
            self._lose(token)
        self._questions.want(due.ask)
        if session is None:
            # The next one begins with asking everybody.
            self._questions.drop()
        else:
            self._ask_who_waits(session, now_ns)
        times = (self._roster.next_due_ns(), self._questions.next_due_ns())
        next_ns = min((at_ns for at_ns in times if at_ns is not None), default=None)
        return None if next_ns is None else max(_STEP_AT_LEAST_S, (next_ns - now_ns) / 1e9)

    def _ask_who_waits(self, session: zenoh.Session, now_ns: int) -> None:
        for name in self._questions.take(now_ns):
            self._ask(session, self._keys.hints if name == EVERYBODY else self._keys.hint(name))

    def _ask(self, session: zenoh.Session, key: str) -> None:
        """Let the announcers on this key say their hints again, to us alone."""
        self._count("asked")
        session.get(
            key,
            self._on_reply,
            # Anyone could declare a queryable "complete" and be the only one to be asked.
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=_ANSWER_WITHIN_S,
        )

    def _on_reply(self, reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            self._on_hint(reply.ok, answering=True)

    def _on_token(self, sample: zenoh.Sample) -> None:
        token = self._keys.token_of(str(sample.key_expr))
        if token is None:
            self._count("bad-keys")
        elif sample.kind == _PUT:
            self._roster.appeared(token, time.monotonic_ns())
        else:
            self._roster.vanished(token, time.monotonic_ns())
        self._keeper.wake()

    def _on_hint(self, sample: zenoh.Sample, *, answering: bool = False) -> None:
        """The road of every message: a callback thread of Zenoh's, in the order sent."""
        entity_id = self._entity_of(str(sample.key_expr))
        if not entity_id:
            self._count("bad-keys")
            return
        attachment = sample.attachment
        envelope = NO_ENVELOPE if attachment is None else decode(attachment.to_bytes())
        if envelope is None:
            self._count("bad-attachments")
            envelope = NO_ENVELOPE
        incarnation, sequence, stamp_ns = envelope
        if answering:
            # It was said after we asked, whatever the sender's clock makes of that: so it is later
            # than the loss after which we asked.
            stamp_ns = 0
        payload = sample.payload.to_bytes()
        # Only what is empty can be a goodbye; asking for the kind costs as much as the payload.
        if not payload and sample.kind != _PUT:
            self._goodbye(entity_id, incarnation, sequence)
            return
        if entity_id in self._awaited:
            self._roster.heard(Token(entity_id, incarnation))
        with self._gate:
            if self._closed:
                return
            self._speaker = get_ident()
            try:
                self._offer(
                    payload,
                    entity_id,
                    entity_id=entity_id,
                    stamp_ns=stamp_ns,
                    incarnation=incarnation,
                    sequence=sequence,
                )
            except Exception:  # noqa: BLE001
                self._sink_raised()
            finally:
                self._speaker = 0

    def _goodbye(self, entity_id: str, incarnation: str, sequence: int) -> None:
        self._roster.left(Token(entity_id, incarnation))
        self._tell(
            lambda sink: sink.goodbye(
                entity_id, entity_id, incarnation=incarnation, sequence=sequence
            )
        )

    def _lose(self, token: Token) -> None:
        why = "its connection ended without a goodbye"
        if self._keeper.config.mode == "client" and not self._keeper.connected:
            why = "the gateway itself lost its connection to the router"
        self._tell(
            lambda sink: sink.lost(
                token.entity_id, token.entity_id, incarnation=token.incarnation, reason=why
            )
        )

    def _tell(self, what: Callable[[HintSink], object]) -> None:
        """Call the sink, unless we are closed. For what is rare: hints go without the detour."""
        with self._gate:
            if self._closed or self._sink is None:
                return
            self._speaker = get_ident()
            try:
                what(self._sink)
            except Exception:  # noqa: BLE001
                self._sink_raised()
            finally:
                self._speaker = 0

    def _sink_raised(self) -> None:
        """Sinks do not raise; one that does must not cost the messages of others."""
        self._count("sink-errors")
        _log.exception("the sink raised")

    def _count(self, what: str) -> None:
        with self._counting:
            self._counters[what] += 1
