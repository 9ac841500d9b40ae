"""Who is there, by their tokens: what follows from a token that comes or goes, and when.

Theory. A token's coming and going is reported beside the hints, in another thread, and may be
reported twice or flap: a fail-over to another router takes a token away and brings it back within
10 ms, and the end of a connection overtakes the last hints sent over it. So nothing follows at
once:

* a token that goes is a *loss* only after ``GRACE_NS``, and not if it is back by then, or if a
  goodbye was heard. Hints that were under way are long through by that time;
* a token that comes should be followed by a hint. If none is heard within ``SETTLE_NS``, the roster
  says that the announcer should be *asked* for it, and again after the longer waits of
  ``ASK_AGAIN_NS``; then it is left to its next beat. So a gateway that starts late, or that lost
  its router for a moment, knows the present without waiting for anyone's period.

The roster holds no thread, no clock and no connection: it is told what happened and when.
"""

from __future__ import annotations

import heapq
import threading

import attrs

from beacon_zenoh.keys import Token

__all__ = ["ASK_AGAIN_NS", "GRACE_NS", "MAX_TOKENS", "SETTLE_NS", "Due", "Roster"]

_MS = 1_000_000

GRACE_NS = 50 * _MS
"""Five times the longest flap that was measured; a twentieth of what "at once" allows."""

SETTLE_NS = 100 * _MS
"""An announcer's first hint follows its token within a few ms; of one that speaks for a thousand,
all hints follow within 100."""

ASK_AGAIN_NS = (200 * _MS, 1000 * _MS)
"""Waits after the first question and the second. A question may come before the announcer's
queryable is known here."""

MAX_TOKENS = 20_000
"""Twice the hints a store holds. A flood of invented tokens beyond it is counted and ignored; the
entities behind ignored tokens fall back on their time to live. So many may be missing too, and so
many awaited: tokens that come and go at once are in neither number for long, but may be many."""

_SLACK = 64
"""Void timers there may be beyond twice the valid ones before they are tidied away."""


@attrs.frozen
class Due:
    """What has to be done now."""

    lost: tuple[Token, ...] = ()
    ask: tuple[str, ...] = ()
    """Entity ids whose announcers should be asked for their hints."""


@attrs.frozen
class _Question:
    """The next time to ask, and how often that was done already."""

    due_ns: int
    asked: int = 0


_NO_QUESTION = _Question(-1)


class Roster:
    """Thread rule: any method from any thread; none blocks or calls back."""

    def __init__(self) -> None:
        self.refused = 0
        """Tokens that were ignored because there were ``MAX_TOKENS`` already."""
        self.overlooked = 0
        """Losses and questions that were not noted because ``MAX_TOKENS`` of their kind were."""
        self.awaited: dict[str, _Question] = {}
        """Entities whose next hint makes a difference here: it is the first since their token came,
        or since their goodbye. For others :meth:`heard` need not be called, which keeps it off the
        road of every message. To be looked at without the lock.
        """
        self._lock = threading.Lock()
        self._present: dict[Token, bool] = {}  # -> has said goodbye
        self._missing: dict[Token, int] = {}  # -> lost if not back by then
        # Tokens to be lost and entities to be asked for; one whose time has since been changed in
        # _missing or awaited is void, and there are hardly more of those than valid ones.
        self._timers: list[tuple[int, int, Token | str]] = []
        self._serial = 0

    def __len__(self) -> int:
        """How many tokens are present."""
        return len(self._present)

    def appeared(self, token: Token, now_ns: int) -> None:
        """A token came, perhaps not for the first time."""
        with self._lock:
            self._missing.pop(token, None)
            if token not in self._present and len(self._present) >= MAX_TOKENS:
                self.refused += 1
                return
            self._present[token] = False
            self._ask_later(token.entity_id, _Question(now_ns + SETTLE_NS))

    def vanished(self, token: Token, now_ns: int) -> None:
        """A token went. One that was not there says nothing."""
        with self._lock:
            self._vanished(token, now_ns + GRACE_NS)

    def all_vanished(self, until_ns: int) -> None:
        """The session that saw them is gone; whoever is there will be back by ``until_ns``."""
        with self._lock:
            for token in list(self._present):
                self._vanished(token, until_ns)

    def heard(self, token: Token) -> None:
        """A hint came: nobody has to be asked, and nobody has left."""
        with self._lock:
            self.awaited.pop(token.entity_id, None)
            for one in _possible(token):
                if one in self._present:
                    self._present[one] = False

    def left(self, token: Token) -> None:
        """A goodbye came: the end of the token will be no loss."""
        with self._lock:
            self.awaited.pop(token.entity_id, None)
            for one in _possible(token):
                self._missing.pop(one, None)
                if one in self._present:
                    self._present[one] = True
                    self.awaited[token.entity_id] = _NO_QUESTION

    def next_due_ns(self) -> int | None:
        """When :meth:`due` may have something; ``None``: not before something happens."""
        with self._lock:
            return self._timers[0][0] if self._timers else None

    def due(self, now_ns: int) -> Due:
        """What has become due; each thing is said once."""
        lost: list[Token] = []
        ask: list[str] = []
        with self._lock:
            while self._timers and self._timers[0][0] <= now_ns:
                due_ns, _, what = heapq.heappop(self._timers)
                if isinstance(what, Token):
                    if self._missing.get(what) == due_ns:
                        del self._missing[what]
                        lost.append(what)
                elif (question := self.awaited.get(what)) and question.due_ns == due_ns:
                    ask.append(what)
                    self._ask_again(what, question.asked, now_ns)
        return Due(tuple(lost), tuple(ask))

    def _vanished(self, token: Token, until_ns: int) -> None:
        said_goodbye = self._present.pop(token, None)
        if said_goodbye:
            self.awaited.pop(token.entity_id, None)
        elif said_goodbye is not None:
            if len(self._missing) >= MAX_TOKENS:
                self.overlooked += 1
                return
            self._missing[token] = until_ns
            self._at(until_ns, token)

    def _ask_again(self, entity_id: str, asked: int, now_ns: int) -> None:
        if asked < len(ASK_AGAIN_NS):
            self._ask_later(entity_id, _Question(now_ns + ASK_AGAIN_NS[asked], asked + 1))
        else:
            del self.awaited[entity_id]

    def _ask_later(self, entity_id: str, question: _Question) -> None:
        if entity_id not in self.awaited and len(self.awaited) >= MAX_TOKENS:
            self.overlooked += 1
            return
        self.awaited[entity_id] = question
        self._at(question.due_ns, entity_id)

    def _at(self, due_ns: int, what: Token | str) -> None:
        if len(self._timers) > 2 * (len(self._missing) + len(self.awaited)) + _SLACK:
            self._tidy()
        self._push(due_ns, what)

    def _tidy(self) -> None:
        """Keep one timer for each that is valid."""
        self._timers = []
        for token, until_ns in self._missing.items():
            self._push(until_ns, token)
        for entity_id, question in self.awaited.items():
            if question is not _NO_QUESTION:
                self._push(question.due_ns, entity_id)

    def _push(self, due_ns: int, what: Token | str) -> None:
        self._serial += 1
        heapq.heappush(self._timers, (due_ns, self._serial, what))


def _possible(token: Token) -> tuple[Token, Token]:
    """A sender that names its incarnation may have left it out of its token."""
    return token, Token(token.entity_id)
