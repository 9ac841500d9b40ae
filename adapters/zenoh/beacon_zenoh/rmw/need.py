"""What the dialects of rmw_zenoh need that may not be installed."""

from __future__ import annotations

from beacon_core.errors import ConfigError

__all__ = ["need_zenoh"]


def need_zenoh(adapter: str) -> None:
    """Raises ``ConfigError``, which says what to install, where eclipse-zenoh or xxhash is not."""
    try:
        import xxhash  # noqa: F401, PLC0415 - to see whether it is there
        import zenoh  # noqa: F401, PLC0415 - the same
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"adapter: {adapter!r} needs eclipse-zenoh and xxhash; "
            "run: pip install 'beacon-core[zenoh]'"
        ) from error
