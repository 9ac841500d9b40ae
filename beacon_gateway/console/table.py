"""The table of entities that ``get`` and ``watch`` show: what needs attention comes first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from beacon_gateway.console.terminal import STATUS_STYLES, cell, duration

__all__ = ["by_attention", "entity_table", "summary"]

Item = Mapping[str, Any]

_ATTENTION = ("conflict", "stale", "left", "active", "-")


def by_attention(items: Iterable[Item]) -> list[Item]:
    """Conflicts first, then the stale, those who left, the active, and those without a beacon."""
    return sorted(items, key=lambda item: (_ATTENTION.index(_state(item)), item["id"]))


def summary(items: Iterable[Item]) -> Text:
    """How many are in which state."""
    counts = Counter(map(_state, items))
    parts = [
        Text(f"{counts[state]} {state}", STATUS_STYLES[state])
        for state in _ATTENTION
        if counts[state] and state in STATUS_STYLES
    ]
    if counts["-"]:
        parts.append(Text(f"{counts['-']} without a beacon", "dim"))
    return Text(" · ").join(parts) if parts else Text("nothing heard yet", "dim")


def entity_table(items: Iterable[Item], rows: int | None = None) -> Table:
    """The items as given; beyond ``rows`` only their number."""
    listed = list(items)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("ENTITY", "STATUS", "AGE", "NAME", "COMPONENT", "PROCESS", "SOURCE", "NOTE"):
        table.add_column(heading, no_wrap=True, justify="right" if heading == "AGE" else "left")
    shown = listed if rows is None else listed[:rows]
    for item in shown:
        table.add_row(*_cells(item))
    if len(shown) < len(listed):
        table.add_row(cell(f"… and {len(listed) - len(shown)} more", "dim"))
    return table


def _cells(item: Item) -> list[Text]:
    beacon = _beacon(item)
    state = _state(item)
    style = STATUS_STYLES.get(state, "")
    return [
        cell(item["id"], "bold"),
        cell(state, style),
        cell(duration(beacon["age_sec"]) if beacon else ""),
        cell("" if item["name"] == item["id"] else item["name"]),
        cell(item.get("x-medkit", {}).get("component_id", "")),
        cell(_process(beacon)),
        cell(beacon.get("source", "")),
        cell(_note(beacon), style),
    ]


def _process(beacon: Mapping[str, Any]) -> str:
    """``name[pid]@host``, as far as given."""
    pid = beacon.get("process_id")
    host = beacon.get("hostname")
    process = f"{beacon.get('process_name', '')}{f'[{pid}]' if pid else ''}"
    return f"{process}@{host}" if host else process


def _note(beacon: Mapping[str, Any]) -> str:
    notes: list[str] = []
    if beacon.get("conflict"):
        notes.append(f"two claim this id ({beacon['status']})")
    if beacon.get("status") == "stale":
        notes.append(beacon.get("reason") or beacon["cause"])
    restarts = beacon.get("restarts")
    if restarts:
        notes.append(f"{restarts} restart{'s' if restarts > 1 else ''}")
    return ", ".join(notes)


def _state(item: Item) -> str:
    beacon = _beacon(item)
    if not beacon:
        return "-"
    return "conflict" if beacon.get("conflict") else str(beacon["status"])


def _beacon(item: Item) -> Mapping[str, Any]:
    beacon: Mapping[str, Any] = item.get("x-medkit", {}).get("beacon", {})
    return beacon
