"""Adapters by name: whatever packages have registered under one of the entry point groups."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Any

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import ENTRY_POINT_GROUP, Adapter
from beacon_core.ports.relaying import (
    CONDUIT_GROUP,
    NETWORK_GROUP,
    ConduitAdapter,
    NetworkAdapter,
)
from beacon_gateway.problems import did_you_mean

__all__ = ["find_installed", "installed", "load_adapter"]

_KINDS: dict[str, tuple[str, type[Any]]] = {
    ENTRY_POINT_GROUP: ("adapter", Adapter),
    CONDUIT_GROUP: ("conduit", ConduitAdapter),
    NETWORK_GROUP: ("network", NetworkAdapter),
}
"""By group: what people call such a thing, and what it must be."""


def installed(group: str = ENTRY_POINT_GROUP) -> dict[str, EntryPoint]:
    """What is registered, by name, whether it can be loaded or not."""
    return {point.name: point for point in entry_points(group=group)}


def load_adapter(name: str) -> Adapter:
    """The source adapter of that name; else as :func:`find_installed`."""
    adapter: Adapter = find_installed(ENTRY_POINT_GROUP, name)
    return adapter


def find_installed(group: str, name: str) -> Any:
    """What is registered by that name; imports its package.

    Raises ``ConfigError`` with one sentence: what is installed, or what must be.
    """
    word, cls = _KINDS[group]
    points = installed(group)
    if name not in points:
        raise ConfigError(f"no {word} {name!r} is installed{_choice(name, points)}")
    point = points[name]
    try:
        found = point.load()
    except ModuleNotFoundError as error:
        raise ConfigError(_missing(word, point, error.name or str(error))) from error
    except Exception as error:  # whatever somebody else's package raises when imported
        raise ConfigError(
            f"the {word} {name!r} ({point.value}) cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    if not isinstance(found, cls):
        raise ConfigError(
            f"{point.value} is registered as the {word} {name!r} "
            f"but is not a {cls.__module__}.{cls.__name__}"
        )
    return found


def _choice(name: str, points: dict[str, EntryPoint]) -> str:
    if not points:
        return "; none is: install beacon-core with an extra, such as beacon-core[zenoh]"
    return did_you_mean(name, sorted(points))


def _missing(word: str, point: EntryPoint, module: str) -> str:
    sentence = f"the {word} {point.name!r} needs the Python module {module!r}"
    if point.dist is not None:
        for extra in point.dist.metadata.get_all("Provides-Extra") or []:
            if point.name == extra or point.name.startswith(f"{extra}_"):
                return f"{sentence}; run: pip install '{point.dist.name}[{extra}]'"
    return f"{sentence}, which is not installed"
