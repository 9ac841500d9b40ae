"""A Zenoh session that is kept open: for sources and announcers alike, whatever they say on it.

Theory. Everything that may wait for the network happens in one daemon thread, the keeper's: opening
(with retries, for as long as there is no router), declaring, the owner's own work (``step``),
closing. So nobody who calls the owner ever waits for the network, closing has a deadline that does
not depend on Zenoh (which may block for 10 s), and a session that has died is replaced. Nothing but
closing ends that thread: what Zenoh cannot do is expected and tried again; any other exception is a
defect, ours or (as a ``BaseException``) a panic of Zenoh's: logged when it first shows, and tried
again too.

Three traps of the Zenoh binding are dealt with here, each measured with 1.10.2:

* a process with a callback on an open session never exits. The callbacks' threads inherit being
  daemons from the thread that declares them, which is this one, so they do not hold the process;
* but then they die while the interpreter is dismantled, which ends the process with SIGABRT (8 of
  8 times under traffic). So at exit, by ``atexit``, what is still open is closed and the threads
  are waited for;
* a client's ``open`` fails when its router is not there, whatever Zenoh's options say.

After a fork, a child has none of these threads. It must make its own source or announcer.
"""

from __future__ import annotations

import atexit
import logging
import os
import threading
import time
import weakref
from collections.abc import Callable, Mapping
from functools import partial

import zenoh

from beacon_core.errors import ConfigError, UsageError
from beacon_core.ports.health import Condition, Health
from beacon_zenoh.config import SessionConfig, reason

__all__ = ["CLOSE_WITHIN_S", "STALLED_AFTER_S", "WATCH_EVERY_S", "SessionKeeper"]

_log = logging.getLogger(__name__)

CLOSE_WITHIN_S = 0.9
"""The ports promise 1 s; the rest is for what the owner does besides."""

WATCH_EVERY_S = 0.5
"""How often the session is looked at when nothing happens."""

STALLED_AFTER_S = 10.0
"""A client that has no router for so long gets a new session. Zenoh reconnects by itself within
half a second of the router's return; should it ever not, this does."""

_RETRY_FIRST_S, _RETRY_FACTOR, _RETRY_LAST_S = 0.1, 1.5, 0.5
"""Waits between attempts to open: as configured for Zenoh's own."""

_CALLBACK_THREAD = "pyo3-closure"
"""What the Zenoh binding calls them."""

_FIRST_ATTEMPT_S = 0.9
"""How long ``start`` waits for it. A client needs 4 ms, with TLS too, and no longer to find that
nobody is there; a router or a peer 5 ms. Only with a router that hangs it takes longer."""


class SessionKeeper:
    """Thread rule: ``start`` once, from any thread; everything else from any, at any time.

    ``declare(session)`` and ``step(session)`` are called in the keeper's thread only. ``declare``
    for each new session, before ``step`` sees it. ``step`` whenever :meth:`wake` was called, and
    after as many seconds as it returned (``None``: no need); with ``None`` while there is no
    session. ``farewell(session)`` is the last word before an orderly close.
    """

    def __init__(
        self,
        config: SessionConfig,
        *,
        declare: Callable[[zenoh.Session], None],
        step: Callable[[zenoh.Session | None], float | None],
        farewell: Callable[[zenoh.Session], None],
    ) -> None:
        self.config = config
        self.reopened = 0
        """Sessions that were found dead and replaced."""
        self.renewed = 0
        """Sessions that were replaced because somebody asked for it."""
        self._declare = declare
        self._step = step
        self._farewell = farewell
        self._pid = os.getpid()
        self._woken = threading.Event()
        self._first_attempt = threading.Event()
        self._thread = threading.Thread(target=self._run, name="beacon-zenoh", daemon=True)
        self._started = False
        self._closing = False
        self._orderly = True
        self._session: zenoh.Session | None = None
        self._links: set[str] = set()
        self._renewing = False
        self._was_up = False
        self._linked_at = time.monotonic()
        self._retry_s = _RETRY_FIRST_S
        self._retry_at = 0.0
        self._error = ""
        # What has failed by a defect, and has not worked since.
        self._reported: set[str] = set()

    def start(self) -> None:
        """Open, or keep trying in the background if a client finds no router.

        Raises ``ConfigError`` if that is impossible, and ``UsageError`` for a second start.
        """
        if self._started or self._closing:
            raise UsageError("start: it was started or closed already; make a new one")
        self._started = True
        _open_keepers.add(self)
        self._thread.start()
        self._first_attempt.wait(_FIRST_ATTEMPT_S)
        if self.config.mode != "client" and self._session is None and self._error:
            error = self._error
            self.close()
            raise ConfigError(
                f"listen: cannot listen at {', '.join(self.config.listen)}: {error}; "
                "stop what uses it, or give another endpoint"
            )

    def wake(self) -> None:
        """Let ``step`` be called soon."""
        self._woken.set()

    def renew(self) -> None:
        """Let another session take the place of this one soon, if it can be opened.

        The new one is declared on before the old one is closed, so nothing is missed, and what is
        said meanwhile may come twice.
        """
        self._renewing = True
        self._woken.set()

    @property
    def connected(self) -> bool:
        """Is anybody at the other end?"""
        return bool(self._links)

    @property
    def closed(self) -> bool:
        """Has :meth:`close` been called?"""
        return self._closing

    @property
    def forked(self) -> bool:
        """Is this a child of the process that made it? Then nothing works, and no lock may be
        taken: the thread that held it may not exist here."""
        return self._pid != os.getpid()

    def close(self, within_s: float = CLOSE_WITHIN_S, *, orderly: bool = True) -> None:
        """End it. Waits at most ``within_s`` for it, though Zenoh may go on in the background.

        Called from ``declare`` or ``step`` it does not wait. Not ``orderly``: without farewell.
        """
        self._orderly = self._orderly and orderly
        self._closing = True
        self._woken.set()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(within_s)

    def health(self, counters: Mapping[str, int]) -> Health:
        """In words for people; with the owner's counters."""
        condition, detail = self._condition()
        own = {"links": len(self._links), "sessions-reopened": self.reopened}
        return Health(condition, detail, {**own, **counters})

    def _condition(self) -> tuple[Condition, str]:
        if self._closing:
            return Condition.CLOSED, ""
        if not self._started:
            return Condition.STARTING, "Not started yet."
        listening = self._session is not None and self.config.mode != "client"
        if self._links or (listening and not self.config.connect):
            return Condition.UP, ""
        where = ", ".join(self.config.connect)
        if listening:
            return Condition.DEGRADED, f"Listening, but not connected to {where}; still trying."
        if self._was_up:
            return Condition.DOWN, f"The connection to {where} was lost; reconnecting by itself."
        return Condition.STARTING, f"No connection to {where} yet; still trying. {self._advice()}."

    def _advice(self) -> str:
        advice = "Start the router there, or correct 'connect'"
        if self.config.document["transport"].get("auth"):
            advice += "; check user and password at both ends, for Zenoh does not say"
        if any(one.startswith(("tls/", "quic/")) for one in self.config.connect):
            advice += "; check the certificates at both ends, for Zenoh does not say"
        return advice

    def _run(self) -> None:
        while not self._closing:
            if self._session is None and time.monotonic() >= self._retry_at:
                self._open()
            if self._renewing:
                self._renew()
            pause = self._guarded_step()
            self._woken.wait(self._limited(pause))
            self._woken.clear()
            self._watch()
        self._end()

    def _limited(self, pause: float | None) -> float:
        limit = WATCH_EVERY_S
        if self._session is None:
            limit = max(0.0, self._retry_at - time.monotonic())
        return limit if pause is None else min(pause, limit)

    def _open(self) -> None:
        try:
            session = zenoh.open(self.config.make())
            self._linked_at = time.monotonic()
            links = self._prepare(session)
        except zenoh.ZError as error:
            self._error = reason(error)
            _log.debug("no session: %s", self._error)
            self._retry_later()
        except BaseException as error:  # noqa: BLE001
            self._error = repr(error)
            self._report("opening a session")
            self._retry_later()
        else:
            self._session, self._links = session, links
            self._retry_s = _RETRY_FIRST_S
            self._reported.discard("opening a session")
        finally:
            self._first_attempt.set()

    def _retry_later(self) -> None:
        self._retry_at = time.monotonic() + self._retry_s
        self._retry_s = min(self._retry_s * _RETRY_FACTOR, _RETRY_LAST_S)

    def _report(self, what: str) -> None:
        """A defect: to be told once, not at each attempt."""
        level = logging.DEBUG if what in self._reported else logging.ERROR
        self._reported.add(what)
        _log.log(level, "%s failed", what, exc_info=True)

    def _renew(self) -> None:
        self._renewing = False
        old = self._session
        if old is None:
            return
        self._open()
        if self._session is not old:
            self.renewed += 1
            _close(old)

    def _prepare(self, session: zenoh.Session) -> set[str]:
        """Returns the session's own set of links: what an old one still reports is no news."""
        links: set[str] = set()
        try:
            listener = partial(self._on_transport, links)
            session.info.declare_transport_events_listener(listener, history=True)
            self._declare(session)
        except BaseException:
            _close(session)
            raise
        return links

    def _guarded_step(self) -> float | None:
        try:
            pause = self._step(self._session)
        except zenoh.ZError as error:
            # The session was closed in the middle; _watch replaces it.
            _log.debug("a session ended in use: %s", reason(error))
        except BaseException:  # noqa: BLE001
            self._report("a step")
        else:
            self._reported.discard("a step")
            return pause
        return None

    def _watch(self) -> None:
        """Drop a session that is dead, so that a new one is opened."""
        session = self._session
        if session is None or self._closing:
            return
        if session.is_closed():
            _log.warning("the Zenoh session was found closed; opening another")
        elif self.config.mode == "client" and self._stalled():
            _log.info("no router for %g s; opening another session", STALLED_AFTER_S)
        else:
            return
        self.reopened += 1
        self._session = None
        self._links = set()
        self._retry_at = 0.0
        _close(session)

    def _stalled(self) -> bool:
        if self._links:
            self._linked_at = time.monotonic()
        return time.monotonic() - self._linked_at > STALLED_AFTER_S

    def _on_transport(self, links: set[str], event: zenoh.TransportEvent) -> None:
        """In a callback thread of its own."""
        zid = str(event.transport.zid)
        if event.kind == zenoh.SampleKind.PUT:
            links.add(zid)
            self._was_up = True
        else:
            links.discard(zid)
        self._woken.set()

    def _end(self) -> None:
        session, self._session = self._session, None
        if session is None:
            return
        try:
            if self._orderly:
                self._farewell(session)
        except zenoh.ZError as error:
            _log.debug("no farewell: %s", reason(error))
        except BaseException:  # noqa: BLE001
            self._report("the farewell")
        finally:
            _close(session)
            self._links = set()


def _close(session: zenoh.Session) -> None:
    try:
        session.close()  # type: ignore[no-untyped-call]
    except zenoh.ZError as error:  # "close operation timed out!", after 10 s
        _log.debug("closing a session: %s", reason(error))
    except BaseException:  # noqa: BLE001
        _log.error("closing a session failed", exc_info=True)


_open_keepers: weakref.WeakSet[SessionKeeper] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    """Close without farewell: to end without ``close`` is to vanish."""
    for keeper in [one for one in _open_keepers if not one.forked]:
        keeper.close(orderly=False)
    # The callbacks' threads end a moment after their session: let that moment pass.
    deadline = time.monotonic() + CLOSE_WITHIN_S
    for thread in threading.enumerate():
        if thread.daemon and _CALLBACK_THREAD in thread.name:
            thread.join(max(0.0, deadline - time.monotonic()))
