"""``beacon run``: the gateway, until it is told to stop."""

from __future__ import annotations

import argparse
import logging
import signal
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import attrs

from beacon_core.errors import BeaconError, ConfigError
from beacon_gateway.config import Config, Loaded, LogLevel, default_config, load_config
from beacon_gateway.exits import Exit, Fault
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import make_app
from beacon_gateway.logs import set_up_logging
from beacon_gateway.problems import headed
from beacon_gateway.server import BindError, HttpServer
from beacon_gateway.terminal import write_json

__all__ = ["parser", "read_config", "run"]

_log = logging.getLogger(__name__)


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Run the gateway until Ctrl-C or SIGTERM. Without a file: one Zenoh source, "
        "the gateway being its own router on tcp/127.0.0.1:7447, and HTTP on 127.0.0.1:8080."
    )
    made.add_argument("-c", "--config", type=Path, metavar="FILE", help="the YAML configuration")
    made.add_argument("--host", help="serve on this address instead of the configured one")
    made.add_argument("--port", type=int, help="serve on this port instead; 0 takes any free one")
    made.add_argument("--log-level", choices=list(LogLevel), help="instead of the configured one")
    made.add_argument(
        "--json", action="store_true", help='once it serves, print {"url": ...} as one line'
    )
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code, once stopped."""
    loaded = read_config(arguments.config)
    config = _overridden(loaded.config, arguments)
    set_up_logging(config.log_level)
    for correction in loaded.corrections:
        _log.warning("%s", correction)
    try:
        server = HttpServer(config.http.host, config.http.port)
    except BindError as error:
        raise Fault(str(error)) from error
    with closing(server), _stopping(server), _started(config) as gateway:
        _log.info("serving %s", server.url)
        if arguments.json:
            write_json({"url": server.url}, indent=None)
        server.serve(make_app(gateway))
    _log.info("stopped")
    return Exit.OK


def read_config(path: Path | None) -> Loaded:
    """The file's configuration, or the embedded default; raises ``ConfigError``."""
    if path is None:
        return default_config()
    try:
        return load_config(path)
    except ConfigError as error:
        raise headed(str(path), error) from error


def _overridden(config: Config, arguments: argparse.Namespace) -> Config:
    host = config.http.host if arguments.host is None else arguments.host
    port = config.http.port if arguments.port is None else arguments.port
    if not 0 <= port <= 65535:
        raise Fault(f"--port {port}: give a port, 0 to 65535", Exit.USAGE)
    level = LogLevel(arguments.log_level or config.log_level)
    return attrs.evolve(
        config, http=attrs.evolve(config.http, host=host, port=port), log_level=level
    )


@contextmanager
def _started(config: Config) -> Iterator[Gateway]:
    try:
        gateway = Gateway(config)
        gateway.start()
    except BeaconError as error:
        raise Fault(str(error)) from error
    with closing(gateway):
        yield gateway


@contextmanager
def _stopping(server: HttpServer) -> Iterator[None]:
    """SIGINT and SIGTERM stop the server, also before it serves and while things are closed."""
    before = {
        number: signal.signal(number, lambda *_: server.stop())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
