"""Networks in memory, and relays between them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

import attrs

from beacon_core.errors import ConfigError
from beacon_core.ports.relaying import CONDUIT_GROUP, NETWORK_GROUP, NetworkAdapter
from beacon_core.ports.topic_side import TopicSide
from beacon_core.relay.values import Qos, TopicType
from beacon_fake.topic_side import FakePublisher, FakeSubscription, FakeTopics
from beacon_gateway.relay.file import RelayFile, parse_relay_file
from beacon_gateway.relay.relay import Relay
from beacon_local import CONDUIT

SOON_S = 10.0
TEXT = TopicType("std_msgs/msg/String", "RIHS01_" + "ab" * 32)
REFUSED = TopicType("nobody/msg/Knows", "RIHS01_" + "00" * 32)


@attrs.frozen
class MemoryOptions:
    """Which of a test's networks."""

    name: str


@attrs.frozen
class Point:
    """What a package has registered."""

    name: str
    load: Callable[[], Any]


class Plant:
    """Networks by name, and relays between them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.networks: dict[str, FakeTopics] = {}
        self.opened = ExitStack()
        self._adapter = NetworkAdapter("memory", MemoryOptions, self._side, lambda one: one.name)

    def network(self, name: str) -> FakeTopics:
        return self.networks.setdefault(name, FakeTopics(refused=[REFUSED]))

    def find(self, group: str, name: str) -> Any:
        known = {(NETWORK_GROUP, "memory"): self._adapter, (CONDUIT_GROUP, "local"): CONDUIT}
        if (group, name) not in known:
            raise ConfigError(f"no {group} {name!r}")
        return known[group, name]

    def entry_points(self, *, group: str) -> Iterable[Point | EntryPoint]:
        """As ``importlib.metadata`` has them."""
        names = {NETWORK_GROUP: "memory", CONDUIT_GROUP: "local"}
        if group not in names:
            return entry_points(group=group)
        return [Point(names[group], partial(self.find, group, names[group]))]

    def config(self, ends: Mapping[str, Any], **more: Any) -> RelayFile:
        document = {
            "ends": ends,
            "state_folder": str(self.folder),
            "identity": str(self.folder),
            **more,
        }
        return parse_relay_file(document, self.find)

    def relay(self, ends: Mapping[str, Any], **more: Any) -> Relay:
        """One that runs until the test has ended."""
        relay = Relay(self.config(ends), find=self.find, **more)
        self.opened.callback(relay.close)
        relay.start()
        return relay

    def publisher(
        self, network: str, topic: str, kind: TopicType = TEXT, **qos: Any
    ) -> FakePublisher:
        return self.network(network).publisher(topic, kind, Qos(**qos))

    def subscription(
        self, network: str, topic: str, kind: TopicType = TEXT, **qos: Any
    ) -> FakeSubscription:
        return self.network(network).subscription(topic, kind, Qos(**qos))

    def _side(self, options: MemoryOptions) -> TopicSide:
        return self.network(options.name).side()


def end(network: str, link: str, **more: Any) -> dict[str, Any]:
    """The configuration of an end."""
    return {
        "network": {"adapter": "memory", "options": {"name": network}},
        "conduit": {"adapter": "local", "options": {"name": link}},
        **more,
    }


def wait_for(true: Callable[[], bool], what: str = "it") -> None:
    deadline = time.monotonic() + SOON_S
    while not true():
        assert time.monotonic() < deadline, f"{what} did not happen"
        time.sleep(0.005)
