"""For tests: a node with parameter services as rmw_zenoh makes them.

Each service is a queryable of its own on its exact key, and nothing is ours but keys, attachments
and the bytes of the messages.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import partial

import zenoh

from beacon_core.parameters.fields import Value
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.lookalikes import open_session
from beacon_zenoh.rmw.tokens import Kind, Member, gid_of, token_key
from beacon_zenoh.rmw_param.messages import Event, encode_event
from beacon_zenoh.rmw_param.services import SERVICES, Service, events_member, service_member
from beacon_zenoh.rmw_param.voices import answer

__all__ = ["ParamRobot"]


class ParamRobot:
    """A node, ``/fleet/r1/talker`` unless named, that can be asked for its parameters."""

    def __init__(
        self,
        endpoint: str,
        parameters: Mapping[str, Value] | None = None,
        *,
        domain: int = 0,
        namespace: str = "/fleet/r1",
        name: str = "talker",
        services: tuple[Service, ...] = SERVICES,
        session: zenoh.Session | None = None,
    ) -> None:
        self.parameters: Mapping[str, Value] = parameters or {}
        self.said: dict[str, bytes] = {}
        """Bytes to answer with instead, by the service's last name."""
        self.asked: list[str] = []
        """Which services were asked."""
        self.answers = threading.Event()
        """Cleared: it hangs."""
        self.answers.set()
        self.session = session or open_session(endpoint)
        self.node = Member(Kind.NODE, domain, str(self.session.zid()), 0, 0, name, namespace)
        self._events = events_member(self.node, 1)
        self._sequence = 0
        members = [self.node, self._events]
        for number, service in enumerate(services, start=2):
            member = service_member(self.node, number, service)
            self.session.declare_queryable(
                data_key(member.data_key), partial(self._on_question, service), complete=True
            )
            members.append(member)
        declare = self.session.liveliness().declare_token
        self.tokens = [declare(token_key(one)) for one in members]

    def tell(self, event: Event) -> None:
        """Publish it, as the node does when its parameters change."""
        self.put_event(encode_event(event, time.time_ns()))

    def put_event(self, payload: bytes) -> None:
        """Publish any bytes as an event."""
        self._sequence += 1
        gid = gid_of(token_key(self._events))
        beside = attachment.encode(gid, self._sequence, time.time_ns())
        self.session.put(data_key(self._events.data_key), payload, attachment=beside)

    def close(self) -> None:
        """End its session, and with it its tokens."""
        self.answers.set()
        self.session.close()  # type: ignore[no-untyped-call]

    def _on_question(self, service: Service, query: zenoh.Query) -> None:
        self.asked.append(service.name)
        self.answers.wait()
        with query:
            envelope = query.attachment and attachment.decode(query.attachment.to_bytes())
            if not envelope or query.payload is None:
                return  # as rmw_zenoh does
            request = query.payload.to_bytes()
            said = self.said.get(service.name) or answer(service.name, self.parameters, request)
            if said is not None:
                beside = attachment.encode(envelope[0], envelope[1], time.time_ns())
                query.reply(query.key_expr, said, attachment=beside)
