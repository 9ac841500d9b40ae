"""Keeps the graph right: reports of tokens, over all the sessions that a source has in its life.

Theory. Tokens are reported by a liveliness subscriber with history, in a thread of Zenoh's. Each
session is told of all tokens anew when it begins; so a new session is a doubt about everybody, and
whoever is not reported again within ``BACK_WITHIN_NS`` has gone.

A token may be reported that nobody holds: a *ghost*. A session that begins in the middle of a
departure may be told of the token and never that it has gone; one on which somebody asks
``liveliness().get()`` while tokens come keeps some of them for ever (eclipse-zenoh 1.9.0 and
1.10.2); and routers have forgotten to tell that a link was lost. Nothing but another session shows
it. So a client takes another session

* at ``RENEW_AFTER`` departures, since it gets slower with each;
* at ``DOUBTED_AFTER_NS`` of age, if its owner has a suspicion: somebody there never answers;
* at ``RENEWED_AFTER_NS`` of age, in any case;

each time only when no token has come or gone for ``QUIET_NS``, or that would make ghosts. What
listens itself, as a router does, is told by the robots' own links, and has no ghosts.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import Protocol

import zenoh

from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.tokens import Member, every_token
from beacon_zenoh.session import SessionKeeper

__all__ = [
    "BACK_WITHIN_NS",
    "DOUBTED_AFTER_NS",
    "QUIET_NS",
    "RENEWED_AFTER_NS",
    "RENEW_AFTER",
    "Watch",
    "Watcher",
]

_SECOND = 1_000_000_000

BACK_WITHIN_NS = _SECOND
"""On a new session the tokens of all who are there are reported again within ms."""

RENEW_AFTER = 2_000
"""So many tokens that have gone, and as many as are there, and a client takes another session: for
each key that it ever saw, those that follow take it longer. After 15,000, 3,000 new tokens took
11 s instead of 0.1 s. A router does not have this."""

DOUBTED_AFTER_NS = 60 * _SECOND
"""As long as rmw_zenoh's lease: who hangs has lost its token by then anyway."""

RENEWED_AFTER_NS = 600 * _SECOND
"""Another session takes the router 0.1 s of work for each thousand tokens."""

QUIET_NS = _SECOND
"""Another session is taken only when no token has come or gone for so long: one that begins in the
middle of a departure may be told of tokens that have gone, and never that they have."""

_TRY_AGAIN_NS = 10 * _SECOND
"""If there was no other session to be had; and for how long questions are waited for."""

_MOMENT_NS = _SECOND // 20

_PUT = zenoh.SampleKind.PUT


class Watcher(Protocol):
    """Is told of members by the keys of their tokens, one call at a time, in threads of Zenoh's;
    of those swept away in the thread that calls :meth:`Watch.step`."""

    def came(self, key: str, member: Member, now_ns: int) -> None:
        """Somebody is new."""

    def came_again(self, key: str, now_ns: int) -> None:
        """Somebody who was known is reported once more."""

    def went(self, key: str, member: Member, now_ns: int) -> None:
        """Somebody has gone."""


class Watch:
    """Thread rule: one thread, the keeper's, but for ``suspect``: any."""

    def __init__(self, domains: Iterable[int], watcher: Watcher, keeper: SessionKeeper) -> None:
        """``keeper``: is woken when something was reported, and asked for other sessions."""
        self.graph = Graph()
        """Who is there."""
        self._domains = tuple(domains)
        self._watcher, self._keeper = watcher, keeper
        # Held during each report of a token: what an old session still has to tell is not heard.
        self._reporting = threading.Lock()
        self._session_number = 0
        self._begun_ns = self._reported_ns = self._renew_not_before_ns = 0
        self._departed = 0
        self._suspected = False
        self._sweep_at_ns: int | None = None

    def begin(self, session: zenoh.Session, doubt: Callable[[int], None]) -> None:
        """Listen on a new session. ``doubt``: told, before the first report of it comes, until when
        those who are there will have been reported again."""
        now_ns = time.monotonic_ns()
        self._sweep_at_ns = now_ns + BACK_WITHIN_NS
        with self._reporting:
            self._session_number += 1
            self._departed, self._suspected = 0, False
            self._begun_ns, self._renew_not_before_ns = now_ns, 0
            doubt(self._sweep_at_ns)
            self.graph.doubt()
        on_token = partial(self._on_token, self._session_number)
        for domain in self._domains:
            # With a callback: the default channel deadlocks on the 257th token. And never
            # liveliness().get on this session: it leaves ghosts in it.
            session.liveliness().declare_subscriber(every_token(domain), on_token, history=True)

    def suspect(self) -> None:
        """Somebody is there by its token alone: look again soon, on another session."""
        self._suspected = True

    def step(self, now_ns: int, *, busy: bool = False) -> int | None:
        """Do what is due; returns when there may be something to do again.

        ``busy``: questions are under way on this session, which would end with it. Another one
        waits for them, but not for ever.
        """
        if self._sweep_at_ns is not None and self._sweep_at_ns <= now_ns:
            self._sweep_at_ns = None
            with self._reporting:
                for key, member in self.graph.sweep():
                    self._watcher.went(key, member, now_ns)
        if self._keeper.config.mode != "client" or not self._keeper.connected:
            return self._sweep_at_ns
        renew_at_ns = self._renew_at_ns()
        if busy and renew_at_ns <= now_ns < renew_at_ns + _TRY_AGAIN_NS:
            renew_at_ns = now_ns + _MOMENT_NS
        elif renew_at_ns <= now_ns:
            self._renew_not_before_ns = renew_at_ns = now_ns + _TRY_AGAIN_NS
            self._keeper.renew()
        return renew_at_ns if self._sweep_at_ns is None else min(renew_at_ns, self._sweep_at_ns)

    def _renew_at_ns(self) -> int:
        if self._departed > max(RENEW_AFTER, len(self.graph)):
            age_ns = 0
        else:
            age_ns = DOUBTED_AFTER_NS if self._suspected else RENEWED_AFTER_NS
        quiet_ns = self._reported_ns + QUIET_NS
        return max(self._begun_ns + age_ns, quiet_ns, self._renew_not_before_ns)

    def _on_token(self, session_number: int, sample: zenoh.Sample) -> None:
        key, came = str(sample.key_expr), sample.kind == _PUT
        with self._reporting:
            if session_number != self._session_number:
                return
            self._reported_ns = now_ns = time.monotonic_ns()
            if came:
                self._arrived(key, now_ns)
            else:
                self._departed += 1
                member = self.graph.vanished(key)
                if member is not None:
                    self._watcher.went(key, member, now_ns)
        self._keeper.wake()

    def _arrived(self, key: str, now_ns: int) -> None:
        known = key in self.graph
        member = self.graph.appeared(key)
        if member is not None:
            self._watcher.came(key, member, now_ns)
        elif known:
            self._watcher.came_again(key, now_ns)
