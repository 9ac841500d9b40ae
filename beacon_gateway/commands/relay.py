"""``beacon relay``: carry topics from one network to another, and see how that goes."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any
from urllib.parse import quote

from rich.live import Live

from beacon_core.errors import BeaconError, ConfigError
from beacon_gateway.console.client import GatewayClient, Unreachable
from beacon_gateway.console.exits import Exit, Fault
from beacon_gateway.console.flags import seconds
from beacon_gateway.console.logs import set_up_logging
from beacon_gateway.console.process import end_watched, keep_memory_together
from beacon_gateway.console.relay_steps import step_line
from beacon_gateway.console.relay_table import explanation, relay_view
from beacon_gateway.console.signals import on_stop_signal
from beacon_gateway.console.terminal import console, printable, write_json
from beacon_gateway.problems import headed
from beacon_gateway.relay.file import RelayFile, load_relay_file
from beacon_gateway.relay.relay import Relay, check_loops
from beacon_gateway.relay.routes import create_relay_app
from beacon_gateway.relay.trace import replay
from beacon_gateway.server import HttpServer

__all__ = ["parser", "run"]

_log = logging.getLogger(__name__)

_DEFAULT_URL = "http://127.0.0.1:8090"
"""Where ``beacon relay`` tells how it is unless told otherwise."""

_PATH = "/x-beacon-relay"


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Carry topics of any type from one network to another. Without an action: "
        "run the ends of a configuration until Ctrl-C or SIGTERM."
    )
    made.add_argument(
        "action",
        nargs="?",
        choices=_ACTIONS,
        default="run",
        help="run it; check its configuration; ask a running one for its status, or to explain why "
        "a topic is carried or not; show a trace; replay one and say whether all is as it was",
    )
    made.add_argument("what", nargs="?", help="explain: the topic; trace, replay: the file")
    made.add_argument("-c", "--config", type=Path, metavar="FILE", help="run, check: the YAML file")
    made.add_argument(
        "--trace", type=Path, metavar="FILE", help="run: write all that happens to this file"
    )
    made.add_argument(
        "--url", default=_DEFAULT_URL, help="status, explain: the relay, or a gateway with one"
    )
    made.add_argument(
        "--watch", type=seconds, nargs="?", const=1.0, metavar="S", help="status: again and again"
    )
    made.add_argument("--json", action="store_true", help="print JSON")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code."""
    return _ACTIONS[arguments.action](arguments)


def _run(arguments: argparse.Namespace) -> int:
    config = _configured(arguments)
    set_up_logging(config.log_level, config.log_format)
    keep_memory_together()
    relay = Relay(config, trace=arguments.trace)
    try:
        with (
            end_watched() as end_begins,
            closing(HttpServer(config.http.host, config.http.port)) as server,
            closing(relay),
        ):
            relay.start()
            _serve(relay, server, as_json=arguments.json)
            end_begins()
    except ConfigError:
        raise
    except BeaconError as error:
        raise Fault(str(error)) from error
    _log.info("stopped")
    return Exit.OK


def _serve(relay: Relay, server: HttpServer, *, as_json: bool) -> None:
    for name, who in relay.names.items():
        _log.info("%s: between %s and %s, origin %016x", name, who.network, who.conduit, who.origin)
    _log.info("telling how it goes at %s; see 'beacon relay status'", server.url)
    if as_json:
        write_json({"url": server.url}, indent=None)
    with on_stop_signal(server.stop):
        server.serve(create_relay_app(relay))


def _check(arguments: argparse.Namespace) -> int:
    config = _configured(arguments)
    check_loops(config)
    if arguments.json:
        write_json({"ok": True, "ends": list(config.ends)})
    else:
        count = len(config.ends)
        ends = "1 end" if count == 1 else f"{count} ends"
        console().print(f"{printable(str(arguments.config))}: ok, {ends}", highlight=False)
    return Exit.OK


def _status(arguments: argparse.Namespace) -> int:
    with GatewayClient(arguments.url) as client:
        told = _asked(client, _PATH)
        if not told["ends"]:
            raise Fault(f"{client.url} runs no relay; name one with --url")
        if arguments.watch is None:
            _print(told, relay_view, as_json=arguments.json)
        else:
            with suppress(KeyboardInterrupt):
                _follow(client, told, arguments)
    return Exit.OK


def _follow(client: GatewayClient, told: Mapping[str, Any], arguments: argparse.Namespace) -> None:
    out = console()
    asked_at = monotonic()
    with Live(relay_view(told), console=out, screen=out.is_terminal, auto_refresh=False) as live:
        while True:
            sleep(arguments.watch)
            before, before_at = told, asked_at
            told, asked_at = _asked(client, _PATH), monotonic()
            if arguments.json:
                write_json(told, indent=None)
            else:
                live.update(relay_view(told, before, asked_at - before_at), refresh=True)


def _explain(arguments: argparse.Namespace) -> int:
    topic = _needed(arguments, "the topic, such as: beacon relay explain /camera/image")
    with GatewayClient(arguments.url) as client:
        told = _asked(client, f"{_PATH}/explain?topic={quote(topic)}")
    _print(told, explanation, as_json=arguments.json)
    carried = any(end["allowed"] and end["routes"] for end in told["ends"])
    return Exit.OK if carried else Exit.NOT_FOUND


def _trace(arguments: argparse.Namespace) -> int:
    path = Path(_needed(arguments, "the file, such as: beacon relay trace relay.trace"))
    out = console()
    for step in replay(path):
        out.print(step_line(step))
    return Exit.OK


def _replay(arguments: argparse.Namespace) -> int:
    path = Path(_needed(arguments, "the file, such as: beacon relay replay relay.trace"))
    count, unlike = 0, []
    for step in replay(path):
        count += 1
        if not step.alike:
            unlike.append(step)
    if arguments.json:
        write_json({"calls": count, "unlike": [step.line for step in unlike]})
    else:
        out = console()
        for step in unlike[:10]:
            out.print(step_line(step))
        verdict = f"{len(unlike)} unlike what was recorded" if unlike else "all as recorded"
        out.print(f"{count} calls replayed: {verdict}", highlight=False)
    return Exit.FAILED if unlike else Exit.OK


def _configured(arguments: argparse.Namespace) -> RelayFile:
    if arguments.config is None:
        raise Fault("-c: give the relay's configuration; docs/relay.md has one", Exit.USAGE)
    try:
        return load_relay_file(arguments.config)
    except ConfigError as error:
        raise headed(str(arguments.config), error) from error


def _needed(arguments: argparse.Namespace, what: str) -> str:
    if not arguments.what:
        raise Fault(f"{arguments.action}: give {what}", Exit.USAGE)
    return str(arguments.what)


def _asked(client: GatewayClient, path: str) -> dict[str, Any]:
    answer = client.get(path)
    if not answer.ok:
        told = printable(str(answer.body.get("message", "")))
        raise Unreachable(f"{client.url}: {told or f'HTTP {answer.status}'}")
    return answer.body


def _print(
    told: Mapping[str, Any], view: Callable[[Mapping[str, Any]], Any], *, as_json: bool
) -> None:
    if as_json:
        write_json(told)
    else:
        console().print(view(told))


_ACTIONS: Mapping[str, Callable[[argparse.Namespace], int]] = {
    "run": _run,
    "check": _check,
    "status": _status,
    "explain": _explain,
    "trace": _trace,
    "replay": _replay,
}
