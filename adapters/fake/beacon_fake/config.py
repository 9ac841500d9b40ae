"""The options of the fake adapter, and the networks of this process by name."""

from __future__ import annotations

import math
import threading

import attrs

from beacon_core.errors import ConfigError, UsageError
from beacon_fake.network import FakeNetwork

__all__ = ["FakeOptions", "find_network", "share_network", "unshare_network"]


def _some_text(_: object, attribute: attrs.Attribute[str], value: str) -> None:
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{attribute.name}: {value!r} is not the name of a network")


def _text(_: object, attribute: attrs.Attribute[str], value: str) -> None:
    if not isinstance(value, str):
        raise ConfigError(f"{attribute.name}: {value!r} is not a name; write a string")


def _finite(_: object, attribute: attrs.Attribute[float], value: float) -> None:
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigError(f"{attribute.name}: {value!r} is not a number of seconds")


@attrs.frozen
class FakeOptions:
    """``adapter: fake`` in a configuration.

    ``ConfigError`` for a value that cannot be; that the network is there is looked up later, when
    a source or an announcer is made.
    """

    network: str = attrs.field(default="default", validator=_some_text)
    """Which network of this process; see :func:`share_network`."""
    name: str = attrs.field(default="", validator=_text)
    """The node's name on it, for links and partitions. Empty: one is made up."""
    clock_offset_s: float = attrs.field(default=0.0, validator=_finite)
    """How far an announcer's wall clock is ahead of the right time; negative: behind."""


_lock = threading.Lock()
_shared: dict[str, FakeNetwork] = {}


def share_network(network: FakeNetwork, name: str = "default") -> None:
    """Let sources and announcers of this process find the network by name.

    Whoever shares it also drives it. Thread rule: any thread. Raises ``UsageError`` if the name
    is taken.
    """
    with _lock:
        if name in _shared:
            raise UsageError(f"share_network: {name!r} is taken; unshare_network({name!r}) first")
        _shared[name] = network


def unshare_network(name: str = "default") -> None:
    """Forget the name. Who found the network before keeps it. Idempotent."""
    with _lock:
        _shared.pop(name, None)


def find_network(name: str) -> FakeNetwork:
    """Raises ``ConfigError`` if nobody shares a network by this name."""
    with _lock:
        network = _shared.get(name)
        names = ", ".join(sorted(_shared)) or "none"
    if network is None:
        raise ConfigError(
            f"network: no fake network is called {name!r} in this process (there are: {names});"
            " make one and pass it to beacon_fake.share_network"
        )
    return network
