"""``beacon get``: one entity, or the list of all."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

from rich.table import Table

from beacon_gateway.console.client import DEFAULT_URL, Answer, GatewayClient
from beacon_gateway.console.exits import Exit, Fault
from beacon_gateway.console.table import by_attention, entity_table
from beacon_gateway.console.terminal import (
    STATUS_STYLES,
    cell,
    console,
    duration,
    printable,
    write_json,
)

__all__ = ["parser", "run"]


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(description="Show one entity, or list all.")
    made.add_argument("entity", nargs="?", metavar="ENTITY", help="the entity's id; without: all")
    made.add_argument("--url", default=DEFAULT_URL, help="the gateway (default: %(default)s)")
    made.add_argument("--json", action="store_true", help="print JSON, as the gateway gives it")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code."""
    with GatewayClient(arguments.url) as client:
        if arguments.entity is None:
            return _list(client, as_json=arguments.json)
        answer = client.beacon(arguments.entity)
    return _one(arguments.entity, answer, as_json=arguments.json)


def _list(client: GatewayClient, *, as_json: bool) -> Exit:
    items = by_attention(client.entities())
    if as_json:
        write_json(items)
    else:
        out = console()
        out.print(entity_table(items, width=out.width))
    return Exit.OK


def _one(entity_id: str, answer: Answer, *, as_json: bool) -> Exit:
    if as_json:
        write_json(answer.body)
    elif answer.ok:
        console().print(_fields(answer.body))
    if answer.ok:
        return Exit.OK
    if as_json and answer.status == 404:
        return Exit.NOT_FOUND
    raise _missing(entity_id, answer)


def _missing(entity_id: str, answer: Answer) -> Fault:
    shown = printable(entity_id)
    left = answer.body.get("parameters", {})
    if left.get("status") == "left":
        ago = duration(left["left_sec"])
        return Fault(f"{shown} left {ago} ago, with a goodbye", Exit.NOT_FOUND)
    if answer.code == "x-medkit-beacon-not-found":
        return Fault(f"{shown} is known, but nothing has been heard of it", Exit.NOT_FOUND)
    if answer.code == "entity-not-found":
        return Fault(f"no entity {shown}; 'beacon get' lists those there are", Exit.NOT_FOUND)
    message = printable(str(answer.body.get("message", "")))
    code = Exit.FAILED if answer.status >= 500 else Exit.USAGE
    return Fault(f"{shown}: {message or f'HTTP {answer.status}'}", code)


def _fields(body: Mapping[str, Any]) -> Table:
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for key, value in body.items():
        if value in ("", [], {}, 0, False, None) and key != "restarts":
            continue
        style = STATUS_STYLES.get(value, "") if key == "status" else ""
        table.add_row(key, cell(_shown(key, value), style))
    return table


def _shown(key: str, value: Any) -> str:
    if key == "age_sec":
        return duration(value)
    if key == "history":
        return "  ".join(f"{step['at']} {step['status']} ({step['cause']})" for step in value)
    if key == "sources":
        return ", ".join(f"{view['source']}: {view['status']}" for view in value)
    if key == "claims":
        return ", ".join(
            f"{claim['process_name']}[{claim['process_id']}]@{claim['hostname']}" for claim in value
        )
    if isinstance(value, dict):
        return ", ".join(f"{name}={text}" for name, text in value.items())
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
