"""The fake network as the contract suite wants it: time is virtual, so no check waits."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import attrs

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter, Decoder
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.source import HintSource
from beacon_core.testing.harness import Capabilities
from beacon_core.testing.hostile import HOSTILE_JSON
from beacon_core.wire import json
from beacon_fake import (
    ADAPTER,
    LOCAL,
    FakeAnnouncer,
    FakeNetwork,
    FakeOptions,
    FakeSource,
    Kind,
    Link,
    Message,
    find_network,
    share_network,
    unshare_network,
)

__all__ = ["FakeHarness"]


class FakeHarness:
    """A :class:`beacon_core.testing.harness.Harness`; each ``network`` is a ``FakeNetwork``.

    ``source``, ``announcer`` and ``decode`` replace parts of the adapter: with a part that has a
    fault, the suite must find it.
    """

    capabilities = Capabilities()
    patience_s = 30.0
    quiet_s = 5.0
    ttl_s = 10.0
    hostile_payloads: Mapping[str, bytes] = HOSTILE_JSON
    bad_options: Sequence[Mapping[str, Any]] = (
        {"network": ""},
        {"network": 7},
        {"name": None},
        {"clock_offset_s": float("nan")},
        {"clock_offset_s": "soon"},
    )

    def __init__(
        self,
        *,
        seed: int = 0,
        link: Link = LOCAL,
        source: Callable[[FakeNetwork], FakeSource] = FakeSource,
        announcer: type[FakeAnnouncer] = FakeAnnouncer,
        decode: Decoder = json.decode,
    ) -> None:
        self.clock = ManualClock()
        self.adapter: Adapter = attrs.evolve(
            ADAPTER,
            source=lambda options: source(find_network(options.network)),
            announcer=lambda options, period_s: announcer(
                find_network(options.network), period_s=period_s
            ),
            decode=decode,
        )
        self._seed, self._link = seed, link
        self._prefix = uuid.uuid4().hex
        self._networks: dict[int, FakeNetwork] = {}
        self._made: list[HintSource | Announcer] = []

    def network(self, number: int = 0) -> FakeNetwork:
        """The network of that number; made and shared when first asked for."""
        if number not in self._networks:
            network = FakeNetwork(self.clock, seed=self._seed + number, link=self._link)
            self._networks[number] = network
            share_network(network, self._name(number))
        return self._networks[number]

    def options(self, network: int = 0) -> FakeOptions:
        self.network(network)
        return FakeOptions(network=self._name(network))

    def source(self, network: int = 0) -> HintSource:
        source = self.adapter.source(self.options(network))
        self._made.append(source)
        return source

    def announcer(
        self,
        period_s: float | None = None,
        network: int = 0,
        *,
        mortal: bool = False,  # noqa: ARG002 - all of them can be killed here
    ) -> Announcer:
        announcer = self.adapter.announcer(self.options(network), period_s)
        self._made.append(announcer)
        return announcer

    def crash(self, announcer: Announcer) -> None:
        assert isinstance(announcer, FakeAnnouncer)  # noqa: S101 - for the type checker
        for network in self._networks.values():
            if announcer.name in network.names():
                network.crash(announcer.name)

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:  # noqa: ARG002 - without a period it is silent
        return nullcontext()

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        return json.encode(hint, stamp_ns)

    def send_raw(
        self,
        entity_id: str,
        payload: bytes,
        *,
        sender: str = "stranger",
    ) -> None:
        self.network().send(Message(Kind.HINT, sender, entity_id, payload))

    def wait_until(self, predicate: Callable[[], bool], deadline_s: float) -> bool:
        deadline_ns = self.clock.monotonic_ns() + int(deadline_s * 1e9)
        while True:
            self._deliver()
            if predicate():
                return True
            if self.clock.monotonic_ns() >= deadline_ns:
                return False
            self._step(deadline_ns)

    def close(self) -> None:
        for thing in reversed(self._made):
            thing.close()
        for number in self._networks:
            unshare_network(self._name(number))

    def _name(self, number: int) -> str:
        return f"{self._prefix}-{number}"

    def _deliver(self) -> None:
        for network in self._networks.values():
            network.deliver_due()

    def _step(self, deadline_ns: int) -> None:
        """On to the next event, but never far: a predicate may depend on time alone."""
        now_ns = self.clock.monotonic_ns()
        due = [network.next_due_ns() for network in self._networks.values()]
        nearest_ns = min(deadline_ns, now_ns + 500_000_000, *(d for d in due if d is not None))
        self.clock.advance(max(0, nearest_ns - now_ns))
