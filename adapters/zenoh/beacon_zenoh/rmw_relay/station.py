"""What there is of a topic side on one Zenoh session: its nodes, and the tokens of their parts.

A node of rmw_zenoh is a token and a number, so one for each mark costs next to nothing.
"""

from __future__ import annotations

import itertools
import threading

import attrs
import zenoh

from beacon_core.relay.effects import CreatePublisher, Subscribe
from beacon_core.relay.marks import Mark, role
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.session import node_member
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key
from beacon_zenoh.rmw_relay.merging import rmw_qos

__all__ = ["MAX_MARKS", "Part", "Station"]

MAX_MARKS = 256
"""Nodes that publish. What has yet another mark goes out under that of its route."""


@attrs.frozen
class Part:
    """A publisher or a subscription, as others see it."""

    member: Member
    key: str
    """That its messages have."""
    gid: bytes
    token: zenoh.LivelinessToken

    def end(self) -> None:
        """Others do not see it any more."""
        self.token.undeclare()  # type: ignore[no-untyped-call]


class Station:
    """Thread rule: any thread. Whatever declares raises ``ZError`` once the session is closed."""

    def __init__(self, session: zenoh.Session, domain: int, name: str) -> None:
        """``name``: what tells this topic side's nodes from those of others."""
        self.session = session
        self.zid = str(session.zid())
        self._domain, self._name = domain, name
        self._lock = threading.Lock()
        self._numbers = itertools.count()
        self._gids: set[bytes] = set()
        self._nodes: dict[Mark, Member] = {}
        # They live as long as somebody holds them.
        self._tokens: list[zenoh.LivelinessToken] = []
        self._listening = self._node(f"_beacon_relay_{name}")

    def owns(self, gid: bytes) -> bool:
        """Is it that of a publisher which is here?"""
        return gid in self._gids

    def subscription(self, what: Subscribe) -> Part:
        """Show that there is one."""
        return self._part(self._listening, Kind.SUBSCRIBER, what)

    def publisher(self, mark: Mark, what: CreatePublisher) -> Part | None:
        """Show that there is one with this mark. ``None`` if there are too many marks; that of
        its route is always there, but as the last it may have none."""
        with self._lock:
            node = self._nodes.get(mark)
            if node is None and len(self._nodes) < MAX_MARKS:
                node = self._nodes[mark] = self._node(f"_beacon_{role(mark)}_{self._name}")
        if node is None:
            if mark != (what.first, 1):
                return None
            node = self._listening
        return self._part(node, Kind.PUBLISHER, what)

    def end(self, part: Part) -> None:
        """It is none of ours any more."""
        part.end()
        self._gids.discard(part.gid)

    def _node(self, name: str) -> Member:
        node = node_member(self._domain, self.zid, next(self._numbers), name)
        self._tokens.append(self.session.liveliness().declare_token(token_key(node)))
        return node

    def _part(self, node: Member, kind: Kind, what: Subscribe | CreatePublisher) -> Part:
        member = attrs.evolve(
            node,
            kind=kind,
            member_id=next(self._numbers),
            name=what.topic,
            type_name=what.type.name,
            type_hash=what.type.digest,
            qos=rmw_qos(what.qos),
        )
        key = token_key(member)
        gid = gid_of(key)
        self._gids.add(gid)
        token = self.session.liveliness().declare_token(key)
        return Part(member, data_key(member.data_key), gid, token)
