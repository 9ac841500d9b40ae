"""The sending end of the fake network."""

from __future__ import annotations

from functools import partial

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition, Health
from beacon_core.wire import json
from beacon_fake.message import Kind, Message
from beacon_fake.network import FakeNetwork

__all__ = ["FakeAnnouncer"]


class FakeAnnouncer:
    """Announces on a :class:`FakeNetwork`; see the ``Announcer`` port for what that promises.

    ``clock_offset_s`` is how far its wall clock, and so its stamps, are ahead of the network's.
    Each entity is repeated every ``period_s``, beginning at a random moment of the first period:
    all at once would exceed the rate that a gateway allows one source. Its state is guarded by the
    network's lock.
    """

    def __init__(
        self,
        network: FakeNetwork,
        name: str = "",
        *,
        period_s: float | None = None,
        clock_offset_s: float = 0.0,
    ) -> None:
        if period_s is not None and not 0 < period_s < float("inf"):
            raise ConfigError(f"period: {period_s!r} is not a time above 0 s")
        self.name = network.free_name(name, "announcer")
        self.incarnation = network.new_incarnation(self.name)
        self._network = network
        self._period_ns = None if period_s is None else max(1, int(period_s * 1e9))
        self._offset_ns = int(clock_offset_s * 1e9)
        self._payloads: dict[str, bytes] = {}
        self._beats: dict[str, int] = {}
        """Which row of repetitions an entity is in; a new one when it comes back."""
        self._sequence = 0
        self._gone = ""
        network.join_sender(self)

    def announce(self, hint: BeaconHint) -> None:
        payload = json.encode(hint)
        with self._network.lock:
            if self._gone:
                raise UsageError(f"announce({hint.entity_id!r}): this announcer has {self._gone}")
            known = hint.entity_id in self._payloads
            self._payloads[hint.entity_id] = payload
            self._network.send(self._hint(hint.entity_id, payload))
            if not known:
                self._begin_beats(hint.entity_id)

    def withdraw(self, entity_id: str) -> None:
        with self._network.lock:
            if self._gone or self._payloads.pop(entity_id, None) is None:
                return
            self._beats.pop(entity_id, None)
            self._network.send(self._message(Kind.GOODBYE, entity_id))

    def close(self) -> None:
        with self._network.lock:
            for entity_id in self.entity_ids():
                self.withdraw(entity_id)
            self._gone = self._gone or "been closed"
            self._network.leave(self)

    def health(self) -> Health:
        with self._network.lock:
            counters = {"entities": len(self._payloads)}
            if self._gone:
                return Health(Condition.CLOSED, counters=counters)
            complaint = self._network.complaint()
        return Health(Condition.DEGRADED if complaint else Condition.UP, complaint, counters)

    def entity_ids(self) -> list[str]:
        """Whom it speaks for, in the order first announced."""
        return list(self._payloads)

    def present(self) -> list[Message]:
        """Each hint said anew; new sequence numbers, since it is true now and not only then."""
        return [self._hint(*one) for one in self._payloads.items()]

    def vanish(self) -> None:
        """Crash; called by :meth:`FakeNetwork.crash`."""
        self._gone = "crashed"

    def _hint(self, entity_id: str, payload: bytes) -> Message:
        stamp_ns = self._network.clock.wall_ns() + self._offset_ns
        return self._message(Kind.HINT, entity_id, payload, stamp_ns)

    def _message(
        self, kind: Kind, entity_id: str, payload: bytes = b"", stamp_ns: int = 0
    ) -> Message:
        self._sequence += 1
        return Message(
            kind, self.name, entity_id, payload, stamp_ns, self.incarnation, self._sequence
        )

    def _begin_beats(self, entity_id: str) -> None:
        if self._period_ns is not None:
            self._beats[entity_id] = row = self._sequence
            first_ns = int(self._period_ns * self._network.chance())
            self._schedule_beat(first_ns, entity_id, row)

    def _schedule_beat(self, in_ns: int, entity_id: str, row: int) -> None:
        due_ns = self._network.clock.monotonic_ns() + in_ns
        self._network.schedule(due_ns, partial(self._beat, entity_id, row))

    def _beat(self, entity_id: str, row: int) -> None:
        with self._network.lock:
            payload = self._payloads.get(entity_id)
            if self._gone or payload is None or self._beats.get(entity_id) != row:
                return
            self._network.send(self._hint(entity_id, payload))
            self._schedule_beat(self._period_ns or 0, entity_id, row)
