"""A relay as text: its ends, what they forward and publish, and how fast."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from beacon_gateway.console.terminal import cell, duration

__all__ = ["explanation", "relay_view", "size"]

_STYLES = {
    "up": "green",
    "open": "green",
    "live": "green",
    "wait-match": "yellow",
    "closed": "dim",
    "idle": "dim",
    "refused": "bold red",
    "down": "bold red",
    "stuck": "bold red",
}

_FINE = frozenset({"sent", "delivered", "conflated"})
"""How messages end when nothing is wrong."""


def relay_view(
    now: Mapping[str, Any], before: Mapping[str, Any] | None = None, elapsed_s: float = 1.0
) -> Group:
    """The report; with the one before it, and the seconds between them, also rates."""
    earlier = {end["name"]: end for end in before["ends"]} if before else {}
    parts: list[RenderableType] = []
    for end in now["ends"]:
        parts += [*_end(end, earlier.get(end["name"]), elapsed_s), Text()]
    return Group(*parts[:-1])


def explanation(told: Mapping[str, Any]) -> Group:
    """Why a topic is carried, or is not."""
    parts: list[RenderableType] = [] if told["ends"] else [Text("no end of this relay forwards")]
    for end in told["ends"]:
        parts.append(cell(f"{end['end']}: {end['reason']}", "green" if end["allowed"] else "red"))
        for route in end["routes"]:
            seen = f"  {route['state']}: {route['reason']}"
            parts.append(cell(f"{seen}{_counts(route)}", _STYLES.get(route["state"], "")))
        if end["allowed"] and not end["routes"]:
            parts.append(Text("  nobody publishes it on this network", "yellow"))
    return Group(*parts)


def size(count: float) -> str:
    """Bytes in few characters: ``512 B``, ``1.5 MB``."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"


def _end(
    end: Mapping[str, Any], before: Mapping[str, Any] | None, elapsed_s: float
) -> Iterator[RenderableType]:
    link, since = end["link"], duration(end["link_since_sec"])
    yield Text.assemble(
        cell(end["name"], "bold"),
        cell(f"  {end['network']} · {end['conduit']} · link "),
        cell(f"{link} for {since}", _STYLES[link]),
    )
    for side, listed, table in (
        ("forward", "routes", _routes),
        ("republish", "topics", _lanes),
    ):
        if side in end:
            was = before.get(side) if before else None
            yield cell(f"{side}: {_books(end[side], was, elapsed_s)}")
            if end[side][listed]:
                yield table(end[side][listed], was[listed] if was else [], elapsed_s)


def _books(books: Mapping[str, Any], was: Mapping[str, Any] | None, elapsed_s: float) -> str:
    rate = f" ({_rate(books['messages'], was['messages'], elapsed_s)})" if was else ""
    missing = f", {books['missing']} missing" if books.get("missing") else ""
    held = f", {books['held']} held ({size(books['held_bytes'])})"
    return f"{books['messages']} messages{rate}{_ended(books['ended'])}{held}{missing}"


def _routes(
    routes: list[Mapping[str, Any]], was: list[Mapping[str, Any]], elapsed_s: float
) -> Table:
    earlier = {one["route"]: one["messages"] for one in was}
    table = _table("TOPIC", "AS", "STATE", "MODE", "MESSAGES", "RATE", "HELD", "NOTE")
    for one in routes:
        state = cell(one["state"], _STYLES.get(one["state"], ""))
        note = one["reason"] if one["state"] == "refused" else _lost(one["ended"])
        rate = _rate(one["messages"], earlier.get(one["route"]), elapsed_s)
        table.add_row(
            cell(one["topic"]),
            cell("" if one["name"] == one["topic"] else one["name"]),
            state,
            cell(one["mode"]),
            cell(one["messages"]),
            cell(rate if one["route"] in earlier else ""),
            cell(size(one["held_bytes"]) if one["held"] else ""),
            cell(note),
        )
    return table


def _lanes(lanes: list[Mapping[str, Any]], _: object, __: float) -> Table:
    table = _table("TOPIC", "TYPE", "STATE", "FOR", "MODE", "WAITING", "MISSING", "NOTE")
    for one in lanes:
        table.add_row(
            cell(one["name"]),
            cell(one["type"]),
            cell(one["state"], _STYLES.get(one["state"], "")),
            cell(duration(one["since_sec"])),
            cell(one["mode"]),
            cell(one["waiting"] or ""),
            cell(one["missing"] or ""),
            cell(one["reason"]),
        )
    return table


def _table(*headings: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in headings:
        right = heading in {"MESSAGES", "RATE", "HELD", "FOR", "WAITING", "MISSING"}
        table.add_column(heading, no_wrap=True, justify="right" if right else "left")
    return table


def _counts(route: Mapping[str, Any]) -> str:
    return f"; {route['messages']} messages{_ended(route['ended'])}"


def _ended(ended: Mapping[str, int]) -> str:
    return "".join(f", {count} {fate}" for fate, count in ended.items())


def _lost(ended: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {fate}" for fate, count in ended.items() if fate not in _FINE)


def _rate(now: int, before: int | None, elapsed_s: float) -> str:
    return f"{(now - (before or 0)) / elapsed_s:.1f}/s"
