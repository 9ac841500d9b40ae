"""``beacon watch``: a running gateway's entities, live."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic, sleep
from typing import NoReturn

from rich.console import Group
from rich.live import Live
from rich.text import Text

from beacon_gateway.console.client import DEFAULT_URL, GatewayClient, Unreachable
from beacon_gateway.console.exits import Exit
from beacon_gateway.console.flags import seconds
from beacon_gateway.console.table import Item, by_attention, entity_table, summary
from beacon_gateway.console.terminal import console, duration, write_json

__all__ = ["parser", "run"]

_FRAME_ROWS = 6
"""Lines of the screen that are not entities."""

_Display = Callable[[list[Item], float | None], None]
"""Shows the entities, and for how many seconds the gateway has not answered."""


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        description="Show a running gateway's entities live, what needs attention first. "
        "Goes on when the gateway is restarted; Ctrl-C ends it."
    )
    made.add_argument("--url", default=DEFAULT_URL, help="the gateway (default: %(default)s)")
    made.add_argument(
        "--interval", type=seconds, default=1.0, metavar="S", help="seconds (default: 1)"
    )
    made.add_argument("--once", action="store_true", help="show it once and end")
    made.add_argument("--json", action="store_true", help="print JSON, one line each time")
    return made


def run(arguments: argparse.Namespace) -> int:
    """Returns the exit code. The first contact must succeed; later ones are tried again."""
    with GatewayClient(arguments.url) as client:
        items = by_attention(client.entities())
        if arguments.once:
            _once(items, as_json=arguments.json)
            return Exit.OK
        with suppress(KeyboardInterrupt), _display(client.url, as_json=arguments.json) as display:
            _follow(client, items, display, arguments.interval)
    return Exit.OK


def _once(items: list[Item], *, as_json: bool) -> None:
    if as_json:
        write_json(items, indent=None)
    else:
        out = console()
        out.print(entity_table(items, width=out.width))
        out.print(summary(items))


def _follow(
    client: GatewayClient, items: list[Item], display: _Display, interval_s: float
) -> NoReturn:
    lost_at: float | None = None
    while True:
        display(items, None if lost_at is None else monotonic() - lost_at)
        sleep(interval_s)
        try:
            items = by_attention(client.entities())
            lost_at = None
        except Unreachable:
            lost_at = monotonic() if lost_at is None else lost_at


@contextmanager
def _display(url: str, *, as_json: bool) -> Iterator[_Display]:
    out = console()
    if as_json:
        yield _json_lines
    elif not out.is_terminal:
        yield lambda items, lost_s: out.print(_frame(url, items, lost_s, out.width, None))
    else:
        with Live(console=out, screen=True, auto_refresh=False) as live:
            # The window may be resized while this runs.
            yield lambda items, lost_s: live.update(
                _frame(url, items, lost_s, out.width, max(1, out.height - _FRAME_ROWS)),
                refresh=True,
            )


def _json_lines(items: list[Item], lost_s: float | None) -> None:
    # Nothing new is known while nobody answers.
    if lost_s is None:
        write_json(items, indent=None)


def _frame(
    url: str, items: list[Item], lost_s: float | None, width: int, rows: int | None
) -> Group:
    state = Text(url, "bold")
    if lost_s is not None:
        state += Text(f"  does not answer for {duration(lost_s)}; trying again", "bold red")
    table = entity_table(items, width=width, rows=rows)
    return Group(state, summary(items), Text(), table, Text())
