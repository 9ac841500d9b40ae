"""What travels on the fake network, and what its nodes look like to it."""

from __future__ import annotations

import enum
from typing import Protocol

import attrs

__all__ = ["Kind", "Message", "Receiver", "Sender"]


class Kind(enum.Enum):
    """What a message is."""

    HINT = "hint"
    GOODBYE = "goodbye"
    LOST = "lost"
    """Sent by nobody: the receiver's end of a connection noticed that the other end is gone."""


@attrs.frozen
class Message:
    """What travels. The payload is beacon JSON; the rest is beside it, as in an envelope."""

    kind: Kind
    sender: str
    entity_id: str = ""
    """Whom it is about. For a HINT: whom alone it may speak for; empty: for anybody."""
    payload: bytes = b""
    stamp_ns: int = 0
    incarnation: str = ""
    sequence: int = 0


class Receiver(Protocol):
    """A source, as the network sees it."""

    @property
    def name(self) -> str: ...

    def receive(self, message: Message) -> None:
        """Called by whoever drives the network, without any lock of the network held."""


class Sender(Protocol):
    """An announcer, as the network sees it. Called with the network's lock held."""

    @property
    def name(self) -> str: ...

    @property
    def incarnation(self) -> str: ...

    def entity_ids(self) -> list[str]:
        """Whom it speaks for."""

    def present(self) -> list[Message]:
        """Its hints said anew, for one who has just come within reach."""

    def vanish(self) -> None:
        """It has crashed: say nothing any more."""
