"""The configuration of a relay that runs by itself: a YAML file, or everything wrong with it."""

from __future__ import annotations

from pathlib import Path

import attrs

from beacon_gateway.adapters import find_installed
from beacon_gateway.config import LogFormat, LogLevel, a_port
from beacon_gateway.documents import read_yaml
from beacon_gateway.relay.config import Find, RelayConfig, register
from beacon_gateway.structuring import Structurer

__all__ = ["RelayFile", "RelayHttp", "load_relay_file", "parse_relay_file"]

_LOOPBACK = ("127.0.0.1", "::1", "localhost")


def _loopback(_: object, __: object, value: str) -> None:
    if value not in _LOOPBACK:
        raise ValueError(
            f"found {ascii(value)[:60]}; this address is for this machine only. To show the relay"
            " to others put it into a gateway's configuration, under relay"
        )


@attrs.frozen
class RelayHttp:
    """Where ``beacon relay status`` asks."""

    host: str = attrs.field(default="127.0.0.1", validator=_loopback)
    port: int = attrs.field(default=8090, validator=a_port)


@attrs.frozen
class RelayFile(RelayConfig):
    """Everything that can be configured."""

    http: RelayHttp = RelayHttp()
    log_level: LogLevel = LogLevel.INFO
    log_format: LogFormat = LogFormat.TEXT


def load_relay_file(path: Path, find: Find = find_installed) -> RelayFile:
    """Read a file. Raises ``ConfigError``: every problem at once, one per line."""
    config = parse_relay_file(read_yaml(path), find)
    return attrs.evolve(config, identity=config.identity or str(path.resolve()))


def parse_relay_file(document: object, find: Find = find_installed) -> RelayFile:
    """Structure what a file holds. Raises as :func:`load_relay_file`."""
    structurer = Structurer()
    register(structurer, find)
    return structurer.structure({} if document is None else document, RelayFile)
