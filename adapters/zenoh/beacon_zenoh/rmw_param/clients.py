"""Asking nodes for their parameters by Zenoh queries to their services.

A question is a query to the service's key, with a request as payload and an attachment that numbers
it. Its answers come in a receiving thread of Zenoh's, where they are put in line and nothing else;
whoever owns this takes them from there (:meth:`ZenohClients.deliver`) and has them read. A Zenoh
callback with a thread of its own takes 600 us for each question; this takes 100.

Anybody may offer a service of this name. Where the token tells which session has the node, answers
of others are dropped.
"""

from __future__ import annotations

import logging
import secrets
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import attrs
import zenoh

from beacon_core.parameters.fields import PREFIX
from beacon_core.ports.asking import Done, Drop, NodeClient
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw_param import messages

__all__ = ["MAX_ANSWERS", "MAX_ANSWER_BYTES", "Doors", "ZenohClients", "ask"]

_log = logging.getLogger(__name__)

MAX_ANSWER_BYTES = 1 << 20
"""What a hint's 500 parameters may take, twice over. A longer answer is none."""

MAX_ANSWERS = 8
"""To one question. One is right; with more, somebody answers in another's name."""

_Decode = Callable[[bytes], Sequence[Any] | None]


@attrs.frozen
class Doors:
    """Where a node is asked."""

    list_key: str
    get_key: str
    zid: str = ""
    """The session that the node belongs to; ``""`` if there are several nodes of this name."""


@attrs.define(eq=False)
class _Question:
    decode: _Decode
    done: Done | None
    """``None``: the answer is not wanted any more."""
    zid: str
    answers: int = 0

    def drop(self) -> None:
        self.done = None

    def finish(self, answer: Sequence[Any] | None) -> None:
        done, self.done = self.done, None
        if done is not None:
            done(answer)


class ZenohClients:
    """A :data:`beacon_core.ports.asking.ClientFactory`.

    Thread rule: one thread.
    """

    def __init__(
        self, doors: Mapping[str, Doors], timeout_s: float, wake: Callable[[], None]
    ) -> None:
        """``doors``: of all nodes that can be asked now, by their names; looked at for each
        question. ``wake``: called in any thread when there is something to deliver."""
        self.session: zenoh.Session | None = None
        """To be asked on; the owner's to set."""
        self.bad_answers = 0
        """Answers that were none: too long, or malformed."""
        self.foreign_answers = 0
        """Answers of others than the node that was asked, and more of them than there should be."""
        self.waiting = 0
        """Questions that have not ended yet."""
        self._doors, self._timeout_s, self._wake = doors, timeout_s, wake
        self._gid = secrets.token_bytes(attachment.GID_BYTES)
        self._sequence = 0
        self._arrived: deque[tuple[_Question, zenoh.Reply | None]] = deque()

    def __call__(self, name: str) -> NodeClient:
        return _ZenohClient(self, name)

    def deliver(self) -> None:
        """Read what has come meanwhile, and hand it to whoever asked."""
        while self._arrived:
            question, reply = self._arrived.popleft()
            self.waiting -= reply is None
            if question.done is None:
                continue
            if reply is None:
                question.finish(None)
            else:
                self._take(question, reply)

    def doors(self, name: str) -> Doors | None:
        """Where this node is asked; ``None`` if it cannot be."""
        return self._doors.get(name)

    def ask(self, key: str, zid: str, request: bytes, decode: _Decode, done: Done) -> Drop:
        """Put one question. Raises ``ZError`` if there is no session to put it on."""
        if self.session is None:
            raise zenoh.ZError("no session")
        question = _Question(decode, done, zid)
        self._sequence += 1
        beside = attachment.encode(self._gid, self._sequence, time.time_ns())
        handler = zenoh.handlers.Callback(
            partial(self._on_reply, question),
            drop=partial(self._on_end, question),
            indirect=False,
        )
        ask(self.session, key, request, beside, handler, self._timeout_s)
        self.waiting += 1
        return question.drop

    def _take(self, question: _Question, reply: zenoh.Reply) -> None:
        if question.zid and reply.replier_id and str(reply.replier_id.zid) != question.zid:
            self.foreign_answers += 1
            return
        answer = None
        if reply.ok is not None:
            if len(reply.ok.payload) <= MAX_ANSWER_BYTES:
                answer = question.decode(reply.ok.payload.to_bytes())
            self.bad_answers += answer is None
        question.finish(answer)

    # -- in receiving threads of Zenoh's ---------------------------------------------------------

    def _on_reply(self, question: _Question, reply: zenoh.Reply) -> None:
        question.answers += 1
        if question.answers > MAX_ANSWERS:
            self.foreign_answers += 1
            return
        self._arrived.append((question, reply))
        self._wake()

    def _on_end(self, question: _Question) -> None:
        """There are no more answers to come: at the latest when the time is over."""
        self._arrived.append((question, None))
        self._wake()


def ask(
    session: zenoh.Session, key: str, request: bytes, beside: bytes, handler: Any, timeout_s: float
) -> Any:
    """Put a question; returns what comes of the handler.

    rmw_zenoh's clients ask those who declare themselves complete, as its services do. Here all are
    asked: others' services may not.
    """
    return session.get(
        key,
        handler,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=timeout_s,
        payload=request,
        attachment=beside,
    )


_OURS = messages.encode_list_request(messages.ListRequest((PREFIX,)))


class _ZenohClient:
    def __init__(self, clients: ZenohClients, name: str) -> None:
        self._clients, self._name = clients, name

    def ready(self) -> bool:
        return self._clients.session is not None and self._clients.doors(self._name) is not None

    def list_names(self, done: Done) -> Drop:
        doors = self._found()
        decode = messages.decode_list_response
        return self._clients.ask(doors.list_key, doors.zid, _OURS, decode, done)

    def get_values(self, names: Sequence[str], done: Done) -> Drop:
        doors = self._found()
        request, decode = messages.encode_names(names), messages.decode_values
        return self._clients.ask(doors.get_key, doors.zid, request, decode, done)

    def close(self) -> None:
        """There is nothing to give up."""

    def _found(self) -> Doors:
        doors = self._clients.doors(self._name)
        if doors is None:
            raise zenoh.ZError("its services are gone")
        return doors
