"""Adapters by name: whatever is installed under the entry point group ``beacon.adapters``."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

from beacon_core.errors import ConfigError
from beacon_core.ports.adapter import ENTRY_POINT_GROUP, Adapter
from beacon_gateway.problems import did_you_mean

__all__ = ["installed", "load_adapter"]


def installed() -> dict[str, EntryPoint]:
    """What is registered, by name, whether it can be loaded or not."""
    return {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}


def load_adapter(name: str) -> Adapter:
    """The adapter of that name; imports its package.

    Raises ``ConfigError`` with one sentence: what is installed, or what must be.
    """
    points = installed()
    if name not in points:
        raise ConfigError(f"no adapter {name!r} is installed{_choice(name, points)}")
    point = points[name]
    try:
        adapter = point.load()
    except ModuleNotFoundError as error:
        raise ConfigError(_missing(point, error.name or str(error))) from error
    except Exception as error:  # whatever somebody else's package raises when imported
        raise ConfigError(
            f"the adapter {name!r} ({point.value}) cannot be loaded: "
            f"{type(error).__name__}: {error}"
        ) from error
    if not isinstance(adapter, Adapter):
        raise ConfigError(
            f"{point.value} is registered as the adapter {name!r} "
            "but is not a beacon_core.ports.adapter.Adapter"
        )
    return adapter


def _choice(name: str, points: dict[str, EntryPoint]) -> str:
    if not points:
        return "; none is: install beacon-core with an extra, such as beacon-core[zenoh]"
    return did_you_mean(name, sorted(points))


def _missing(point: EntryPoint, module: str) -> str:
    sentence = f"the adapter {point.name!r} needs the Python module {module!r}"
    extras = point.dist.metadata.get_all("Provides-Extra") or [] if point.dist else []
    if point.dist and point.name in extras:
        return f"{sentence}; run: pip install '{point.dist.name}[{point.name}]'"
    return f"{sentence}, which is not installed"
