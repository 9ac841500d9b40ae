"""All ends of a configuration, from their making to their end."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

import attrs

from beacon_core.clock import Clock, SystemClock
from beacon_core.errors import ConfigError
from beacon_core.ports.relaying import CONDUIT_GROUP, NETWORK_GROUP
from beacon_core.relay.names import Link, find_loop
from beacon_gateway.adapters import find_installed
from beacon_gateway.relay.births import ForwarderBirth, RepublisherBirth
from beacon_gateway.relay.config import EndConfig, Find, RelayConfig
from beacon_gateway.relay.end import End, State
from beacon_gateway.relay.identity import default_state_folder, new_asker, next_epoch, origin_of
from beacon_gateway.relay.squeeze import SqueezingConduit
from beacon_gateway.relay.trace import TraceFile

__all__ = ["EndName", "Relay", "check_loops"]


@attrs.frozen
class EndName:
    """What an end stands between, and who it is."""

    network: str
    conduit: str
    origin: int
    epoch: int


class Relay:
    """Thread rule: ``start`` and ``close`` from one thread, all else from any."""

    def __init__(
        self,
        config: RelayConfig,
        *,
        trace: Path | None = None,
        clock: Clock | None = None,
        find: Find = find_installed,
    ) -> None:
        """Opens nothing.

        Raises ``ConfigError`` if the names let a message go round in circles.
        """
        check_loops(config, find)
        self._config, self._find = config, find
        self._trace = trace
        self.clock: Clock = SystemClock() if clock is None else clock
        self.ends: Mapping[str, End] = {}
        self.names: Mapping[str, EndName] = {}
        self._opened = ExitStack()

    def start(self) -> None:
        """Begin with all ends. Raises what one of them raises; then none has begun."""
        with ExitStack() as opened:
            trace = None if self._trace is None else opened.enter_context(TraceFile(self._trace))
            names = {name: self._name(name, opened) for name in self._config.ends}
            ends: dict[str, End] = {}
            for name in names:
                end = self._end(name, names, trace)
                opened.callback(end.close)
                end.start()
                ends[name] = end
            self.names, self.ends = names, ends
            self._opened = opened.pop_all()

    def states(self) -> dict[str, State | None]:
        """How all ends are now; ``None`` of one that is stuck: it has not answered for a second."""
        found: dict[str, State | None] = {}
        for name, end in self.ends.items():
            try:
                found[name] = end.state()
            except TimeoutError:
                found[name] = None
        return found

    def close(self) -> None:
        """End all ends. Idempotent."""
        self._opened.close()

    def _name(self, name: str, opened: ExitStack) -> EndName:
        config = self._config.ends[name]
        origin = config.origin or origin_of(self._config.identity, name)
        folder = self._config.state_folder or default_state_folder()
        epoch = opened.enter_context(next_epoch(folder, origin, self.clock))
        return EndName(*_identities(config, self._find), origin, epoch)

    def _end(self, name: str, names: Mapping[str, EndName], trace: TraceFile | None) -> End:
        config, who = self._config.ends[name], names[name]
        now_ns = self.clock.monotonic_ns()
        own = tuple(one.origin for one in names.values() if one.network == who.network)
        forwarder = republisher = None
        if (forward := config.forward) is not None:
            forwarder = ForwarderBirth(
                who.origin, who.epoch, forward.names(), forward.settings(), now_ns
            )
        if (republish := config.republish) is not None:
            republisher = RepublisherBirth(new_asker(), own, republish.settings(), now_ns)
        compress = config.forward is not None and config.forward.compress
        network = self._find(NETWORK_GROUP, config.network.adapter)
        conduit = self._find(CONDUIT_GROUP, config.conduit.adapter)
        return End(
            name,
            network.topic_side(config.network.options),
            SqueezingConduit(conduit.conduit(config.conduit.options), squeezes=compress),
            self.clock,
            forwarder=forwarder.make() if forwarder else None,
            republisher=republisher.make() if republisher else None,
            trace=trace.of(name, (forwarder, republisher)) if trace else None,
        )


def check_loops(config: RelayConfig, find: Find = find_installed) -> None:
    """Raises ``ConfigError`` if a message could pass one rule of the configuration twice."""
    identities = {name: _identities(one, find) for name, one in config.ends.items()}
    links = []
    for name, one in config.ends.items():
        for other, heard in config.ends.items():
            joined = name != other and identities[name][1] == identities[other][1]
            if joined and one.forward is not None and heard.republish is not None:
                links.append(Link(identities[name][0], identities[other][0], one.forward.names()))
    loop = find_loop(links)
    if loop is not None:
        way = "\n  ".join(loop)
        raise ConfigError(
            "ends: a message could go round in circles; rename the topics of one way, or deny what"
            f" comes back:\n  {way}"
        )


def _identities(config: EndConfig, find: Find) -> tuple[str, str]:
    network = find(NETWORK_GROUP, config.network.adapter)
    conduit = find(CONDUIT_GROUP, config.conduit.adapter)
    return network.identity(config.network.options), conduit.identity(config.conduit.options)
