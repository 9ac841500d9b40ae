"""What can be configured of a relay, and how a document is read as that.

The reference for people is docs/relay.md; the same keys in the same order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

import attrs

from beacon_core.ports.relaying import CONDUIT_GROUP, NETWORK_GROUP
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.settings import Forwarding, Republishing
from beacon_core.relay.shaping import Shaping, is_rate
from beacon_core.relay.values import Mode
from beacon_gateway.adapters import find_installed
from beacon_gateway.ids import named
from beacon_gateway.structuring import Structurer

__all__ = [
    "ConduitConfig",
    "EndConfig",
    "Find",
    "ForwardConfig",
    "NetworkConfig",
    "RelayConfig",
    "RepublishConfig",
    "RuleConfig",
    "register",
]

Find = Callable[[str, str], Any]
"""Gives the adapter of a group and a name, or raises ``ConfigError``."""


def _pattern_of_one(instance: RuleConfig, _: object, value: str) -> None:
    if bool(value) == bool(instance.allow):
        raise ValueError("give one of allow and deny, with a pattern such as /camera/**")


def _origin(_: object, __: object, value: int | None) -> None:
    if value is not None and not 0 < value < 2**63:
        raise ValueError("give a whole number above 0 and below 2**63, or leave it out")


@attrs.frozen
class NetworkConfig:
    """The network beside an end."""

    adapter: str = attrs.field(metadata={"right": "the name of an installed network"})
    options: Any = None
    """An instance of the adapter's own options class."""


@attrs.frozen
class ConduitConfig:
    """The way to the other ends."""

    adapter: str = attrs.field(metadata={"right": "the name of an installed conduit"})
    options: Any = None
    """An instance of the adapter's own options class."""


def _rate(_: object, attribute: attrs.Attribute[float], value: float | None) -> None:
    if value is not None and not is_rate(value):
        raise ValueError(f"found {value!r}; give a number above 0, or leave {attribute.name} out")


@attrs.frozen
class RuleConfig:
    """One line: which topics are carried, under which name, and how; or which are not."""

    allow: str = ""
    deny: str = attrs.field(default="", validator=_pattern_of_one)
    to: str = ""
    mode: Literal["ordered", "latest", "best_effort", "state"] | None = None
    rate_hz: float | None = None
    bytes_per_s: float | None = None
    max_age_s: float | None = None
    priority: int = 0

    def rule(self) -> Rule:
        """The same for the core. ``ConfigError`` if it cannot be understood."""
        mode = None if self.mode is None else Mode[self.mode.upper()]
        max_age_ns = None if self.max_age_s is None else _ns(self.max_age_s)
        shaping = Shaping(self.rate_hz, self.bytes_per_s, max_age_ns, self.priority)
        return Rule(bool(self.allow), self.allow or self.deny, self.to, mode, shaping)


@attrs.frozen
class ForwardConfig:
    """From the network into the conduit. The limits are those of :class:`.Forwarding`."""

    rules: tuple[RuleConfig, ...] = ()
    compress: bool = False
    """With Zstandard, each topic that gains by it."""
    hold_bytes: int = attrs.field(default=Forwarding().hold_bytes, metadata={"at_least": 0})
    message_bytes: int = attrs.field(default=Forwarding().message_bytes, metadata={"at_least": 0})
    max_routes: int = attrs.field(default=Forwarding().max_routes, metadata={"at_least": 1})
    max_hops: int = attrs.field(default=Forwarding().max_hops, metadata={"at_least": 1})
    link_bytes_per_s: float | None = attrs.field(default=None, validator=_rate)

    def names(self) -> NameMap:
        """The rules for the core."""
        return NameMap(tuple(one.rule() for one in self.rules))

    def settings(self) -> Forwarding:
        """The limits for the core."""
        return Forwarding(
            hold_bytes=self.hold_bytes,
            message_bytes=self.message_bytes,
            max_routes=self.max_routes,
            max_hops=self.max_hops,
            link_bytes_per_s=self.link_bytes_per_s,
        )


@attrs.frozen
class RepublishConfig:
    """From the conduit to the network. The limits are those of :class:`.Republishing`."""

    hold_bytes: int = attrs.field(default=Republishing().hold_bytes, metadata={"at_least": 0})
    max_origins: int = attrs.field(default=Republishing().max_origins, metadata={"at_least": 1})
    gap_s: float = attrs.field(default=1.0, metadata={"at_least": 0.0})
    match_s: float = attrs.field(default=0.5, metadata={"at_least": 0.0})
    advertise_delay_s: float | None = None

    def settings(self) -> Republishing:
        """The limits for the core."""
        delay_s = self.advertise_delay_s
        return Republishing(
            hold_bytes=self.hold_bytes,
            max_origins=self.max_origins,
            gap_ns=_ns(self.gap_s),
            match_ns=_ns(self.match_s),
            advertise_delay_ns=None if delay_s is None else _ns(delay_s),
        )


@attrs.frozen
class EndConfig:
    """One network, one conduit, and what goes which way."""

    network: NetworkConfig = attrs.field(metadata={"right": "a network, such as {adapter: ros}"})
    conduit: ConduitConfig = attrs.field(metadata={"right": "a conduit, such as {adapter: zenoh}"})
    forward: ForwardConfig | None = None
    republish: RepublishConfig | None = None
    origin: int | None = attrs.field(default=None, validator=_origin)
    """``None``: made from what this machine is, the configuration's path and the end's name."""


@attrs.frozen
class RelayConfig:
    """Everything that can be configured."""

    ends: Mapping[str, EndConfig] = attrs.field(
        validator=named(
            "an end", "found no end; give at least one, such as {robot: {network: ...}}"
        ),
        metadata={"right": "ends by name, such as {robot: {network: ...}}"},
    )
    state_folder: Path | None = None
    """``None``: where programs of this user keep their state."""
    identity: str = ""
    """What tells this relay's ends from those of others on this machine, for ever; empty: where
    the configuration lies."""


def register(structurer: Structurer, find: Find = find_installed) -> None:
    """Let a document hold a :class:`RelayConfig`."""
    structurer.hook(EndConfig, lambda value: _end(value, structurer))
    for cls, group in ((NetworkConfig, NETWORK_GROUP), (ConduitConfig, CONDUIT_GROUP)):
        structurer.hook(cls, partial(_carrier, cls, group, structurer, find))
    structurer.hook(RuleConfig, lambda value: _rule(value, structurer))


def _end(value: object, structurer: Structurer) -> EndConfig:
    given = dict(structurer.mapping(value))
    if isinstance(given.get("forward"), list):
        given["forward"] = {"rules": given["forward"]}
    if isinstance(given.get("republish"), bool):
        given["republish"] = {} if given["republish"] else None
    end = structurer.fields(given, EndConfig)
    if end.forward is None and end.republish is None:
        structurer.note("this end does nothing; give forward with rules, or republish: true")
    return end


def _carrier(cls: type[Any], group: str, structurer: Structurer, find: Find, value: object) -> Any:
    given = dict(structurer.mapping(value))
    options = given.pop("options", None)
    adapter = None
    with structurer.at(".adapter"):
        name = given.get("adapter")
        adapter = find(group, name) if isinstance(name, str) else None
    if adapter is not None:
        with structurer.at(".options"):
            given["options"] = structurer.part(options, adapter.options)
    return structurer.fields(given, cls)


def _rule(value: object, structurer: Structurer) -> RuleConfig:
    rule = structurer.fields(value, RuleConfig)
    rule.rule()
    return rule


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
