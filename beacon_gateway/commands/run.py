"""``beacon run``: the gateway, until it is told to stop."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import attrs

from beacon_core.errors import BeaconError, ConfigError
from beacon_gateway.access.access import Access
from beacon_gateway.access.exposure import check_exposure
from beacon_gateway.config import Config, Loaded, LogLevel, default_config, load_config
from beacon_gateway.console.exits import Exit, Fault
from beacon_gateway.console.flags import port
from beacon_gateway.console.logs import set_up_logging
from beacon_gateway.console.process import (
    end_watched,
    keep_answers_prompt,
    keep_memory_together,
    memory_given_back,
)
from beacon_gateway.console.signals import on_reload_signal, on_stop_signal
from beacon_gateway.console.terminal import write_json
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.problems import headed
from beacon_gateway.reload import Reload
from beacon_gateway.server import HttpServer, allow_connections
from beacon_gateway.tls import server_context

__all__ = ["opened", "parser", "read_config", "run"]

_log = logging.getLogger(__name__)

_OTHER_CONNECTIONS = 2048
"""Beside the streams: clients keep theirs open for some seconds after each answer."""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Run the gateway until Ctrl-C or SIGTERM; SIGHUP reads the file again. "
        "Without a file: one Zenoh source, the gateway being its own router on "
        "tcp/127.0.0.1:7447, and HTTP on 127.0.0.1:8080."
    )
    made.add_argument("-c", "--config", type=Path, metavar="FILE", help="the YAML configuration")
    made.add_argument("--host", help="serve on this address instead of the configured one")
    made.add_argument("--port", type=port, help="serve on this port instead; 0 takes any free one")
    made.add_argument(
        "--allow-insecure",
        action="store_true",
        help="serve on other than the loopback although TLS or authentication is missing",
    )
    made.add_argument("--log-level", choices=list(LogLevel), help="instead of the configured one")
    made.add_argument(
        "--json", action="store_true", help='once it serves, print {"url": ...} as one line'
    )
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code, once stopped."""
    keep_memory_together()
    loaded = _read(arguments)
    config = loaded.config
    _log_as(config)
    for correction in loaded.corrections:
        _log.warning("%s", correction)
    access = Access(config.http)
    with (
        end_watched() as end_begins,
        opened(config) as (server, gateway),
        on_stop_signal(server.stop),
        memory_given_back(),
    ):
        _log.info("serving %s", server.url)
        if arguments.json:
            write_json({"url": server.url}, indent=None)
        connections = config.http.max_streams + _OTHER_CONNECTIONS
        allow_connections(connections)
        reload = Reload(lambda: _read(arguments), gateway, access, server, _log_as)
        app = create_app(gateway, access)
        keep_answers_prompt()
        with on_reload_signal(reload):
            server.serve(
                app,
                at_stop=gateway.stopping.set,
                max_connections=connections,
            )
        end_begins()
    _log.info("stopped")
    return Exit.OK


@contextmanager
def opened(config: Config) -> Iterator[tuple[HttpServer, Gateway]]:
    """A gateway that listens, and a server that has its address; closed in the end.

    Raises ``Fault`` with one sentence if either cannot be had, and ``ConfigError`` for an address
    that nobody has decided to open, or a certificate that is none.
    """
    http = config.http
    warning = check_exposure(http)
    tls = None if http.tls is None else server_context(http.tls)
    try:
        # The address first: it is what most often cannot be had, and the cheapest to try.
        with closing(HttpServer(http.host, http.port, tls)) as server:
            if warning:
                _log.warning("%s", warning)
            gateway = Gateway(config)
            gateway.start()
            with closing(gateway):
                yield server, gateway
    except BeaconError as error:
        raise Fault(str(error)) from error


def read_config(path: Path | None) -> Loaded:
    """The file's configuration, or the embedded default; raises ``ConfigError``."""
    if path is None:
        return default_config()
    try:
        return load_config(path)
    except ConfigError as error:
        raise headed(str(path), error) from error


def _read(arguments: argparse.Namespace) -> Loaded:
    """The configuration with what the command line says instead."""
    loaded = read_config(arguments.config)
    return attrs.evolve(loaded, config=_overridden(loaded.config, arguments))


def _log_as(config: Config) -> None:
    set_up_logging(config.log_level, config.log_format)


def _overridden(config: Config, arguments: argparse.Namespace) -> Config:
    given = {"host": arguments.host, "port": arguments.port}
    http = attrs.evolve(
        config.http,
        **{name: value for name, value in given.items() if value is not None},
        allow_insecure=config.http.allow_insecure or arguments.allow_insecure,
    )
    level = LogLevel(arguments.log_level or config.log_level)
    return attrs.evolve(config, http=http, log_level=level)
