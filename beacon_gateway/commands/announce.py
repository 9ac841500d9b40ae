"""``beacon announce``: speak for entities until stopped, then say goodbye for them."""

from __future__ import annotations

import argparse
import logging
import math
import threading
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import attrs
import yaml

from beacon_core.errors import BeaconError, ConfigError
from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.health import Condition, Health
from beacon_gateway.adapters import load_adapter
from beacon_gateway.config import LogLevel
from beacon_gateway.console.exits import Exit, Fault
from beacon_gateway.console.flags import seconds
from beacon_gateway.console.hints import Checked, checked_hint, read_hints, this_process
from beacon_gateway.console.logs import set_up_logging
from beacon_gateway.console.signals import on_stop_signal, wait
from beacon_gateway.problems import headed
from beacon_gateway.structuring import Structurer

__all__ = ["parser", "run"]

_log = logging.getLogger(__name__)

_LOOK_S = 0.5
"""How often the carrier's health is looked at."""

_FIELDS: Mapping[str, str] = {
    "entity_id": "whom the hint is about: an app or a component",
    "stable_id": "an id that survives renames, such as a serial number",
    "display_name": "a name for people",
    "function_ids": "the functions it takes part in",
    "depends_on": "the entities it cannot work without",
    "component_id": "the component that hosts it",
    "transport_type": "how its data travels, such as shared_memory",
    "negotiated_format": "the data format agreed on",
    "process_id": "default: this process's",
    "process_name": "default: this program's",
    "hostname": "default: this machine's",
    "metadata": "anything else worth showing",
}


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Announce one entity (by the options below) or those of a YAML file, again "
        "each period, until Ctrl-C or SIGTERM; then say goodbye for them. Process id, process "
        "name and hostname are this process's unless given."
    )
    made.add_argument("file", nargs="?", type=Path, metavar="FILE", help="one hint, or a list")
    fields = made.add_argument_group("what to announce, instead of a file")
    for field in attrs.fields(BeaconHint):
        _add_field(fields, field)
    way = made.add_argument_group("how")
    way.add_argument(
        "--adapter",
        default="zenoh",
        help="the carrier, such as zenoh, ros_topic or ros_param (default: %(default)s)",
    )
    way.add_argument(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="zenoh: the gateway's router; may be repeated (default: tcp/127.0.0.1:7447)",
    )
    way.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        type=_option,
        help="an option of the adapter, such as domain_id=7 of the ROS ones; the value in YAML; "
        "may be repeated",
    )
    way.add_argument("--period", type=seconds, default=2.0, metavar="S", help="default: 2")
    way.add_argument("--duration", type=seconds, metavar="S", help="stop by itself after this")
    way.add_argument("--log-level", choices=list(LogLevel), default=LogLevel.INFO)
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code, once stopped."""
    set_up_logging(LogLevel(arguments.log_level))
    checked = [checked_hint(hint, this_process()) for hint in _hints(arguments)]
    adapter = load_adapter(arguments.adapter)
    options = _options(adapter, arguments)
    stop = threading.Event()
    with on_stop_signal(stop.set):
        try:
            announcer = adapter.announcer(options, arguments.period)
        except BeaconError as error:
            raise Fault(str(error)) from error
        with closing(announcer):
            _announce(announcer, checked, arguments)
            trouble = _attend(announcer, stop, arguments.duration)
    if trouble:
        _log.warning("ended without a goodbye: nobody was there to hear it")
    else:
        _log.info("said goodbye")
    return Exit.OK


def _announce(announcer: Announcer, checked: list[Checked], arguments: argparse.Namespace) -> None:
    for one in checked:
        for repair in one.repairs:
            _log.warning("%s: %s", one.hint.entity_id, repair)
        announcer.announce(one.hint)
    _log.info(
        "announcing %s over %s every %g s; Ctrl-C says goodbye",
        ", ".join(one.hint.entity_id for one in checked),
        arguments.adapter,
        arguments.period,
    )


def _attend(announcer: Announcer, stop: threading.Event, duration_s: float | None) -> str:
    """Wait for the end, and tell when the carrier fails or works again.

    Returns what ails the carrier in the end, "" if nothing does.
    """
    end_s = math.inf if duration_s is None else time.monotonic() + duration_s
    trouble = ""
    while True:
        # First wait, then look: a connection takes a moment.
        ended = wait(stop, max(0.0, min(end_s - time.monotonic(), _LOOK_S)))
        before, trouble = trouble, _trouble(announcer.health())
        if trouble and not before:
            _log.warning("%s", trouble)
        elif before and not trouble:
            _log.info("connected")
        if ended or time.monotonic() >= end_s:
            return trouble


def _trouble(health: Health) -> str:
    if health.condition is Condition.UP:
        return ""
    return health.detail or f"the carrier is {health.condition}"


def _hints(arguments: argparse.Namespace) -> list[BeaconHint]:
    given: dict[str, Any] = {
        field.name: value
        for field in attrs.fields(BeaconHint)
        if (value := getattr(arguments, field.name)) is not None
    }
    if arguments.file is not None and given:
        flag = f"--{next(iter(given)).replace('_', '-')}"
        raise Fault(f"give a file or {flag}, not both", Exit.USAGE)
    if arguments.file is not None:
        return read_hints(arguments.file)
    if "entity_id" not in given:
        raise Fault("say what to announce: a FILE, or at least --entity-id", Exit.USAGE)
    for name in ("function_ids", "depends_on"):
        given[name] = tuple(given.get(name, ()))
    return [BeaconHint(**{**given, "metadata": dict(given.get("metadata", ()))})]


def _options(adapter: Adapter, arguments: argparse.Namespace) -> Any:
    given = dict(arguments.option)
    if arguments.connect:
        given["connect"] = arguments.connect
    try:
        return Structurer().structure(given, adapter.options)
    except ConfigError as error:
        raise headed(f"options of {adapter.name}", error) from error


def _add_field(group: argparse._ArgumentGroup, field: attrs.Attribute[Any]) -> None:
    flag, text = f"--{field.name.replace('_', '-')}", _FIELDS[field.name]
    if field.name == "metadata":
        group.add_argument(
            flag, action="extend", nargs="+", type=_pair, metavar="KEY=TEXT", help=text
        )
    elif field.name == "process_id":
        group.add_argument(flag, type=_process_id, metavar="NUMBER", help=text)
    elif field.name in ("function_ids", "depends_on"):
        group.add_argument(flag, action="extend", nargs="+", metavar="ID", help=text)
    else:
        metavar = "ID" if field.name.endswith("_id") else "TEXT"
        group.add_argument(flag, metavar=metavar, help=text)


def _pair(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not (key and equals):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form KEY=VALUE")
    return key, value


def _option(text: str) -> tuple[str, object]:
    key, value = _pair(text)
    try:
        return key, yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: the value is not YAML") from error


def _process_id(text: str) -> int:
    if text.isascii() and text.isdigit() and int(text) < 2**32:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is no process id, 0 to {2**32 - 1}")
