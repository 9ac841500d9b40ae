"""The table of entities that ``get`` and ``watch`` show: what needs attention comes first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from rich.table import Table
from rich.text import Text

from beacon_gateway.console.terminal import STATUS_STYLES, cell, duration

__all__ = ["Item", "by_attention", "entity_table", "summary"]

Item = Mapping[str, Any]
"""One entity as the gateway lists it: an element of ``items`` in the answer."""

_HEADINGS = ("ENTITY", "STATUS", "AGE", "NAME", "COMPONENT", "PROCESS", "SOURCE", "NOTE")
_NEVER_CUT = {"STATUS": len("conflict"), "AGE": len("59 min")}
_GAP = 2
"""Columns of the terminal between two columns of the table."""

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


def entity_table(items: Iterable[Item], *, width: int, rows: int | None = None) -> Table:
    """The items as given, in ``width`` columns of the terminal; beyond ``rows`` their number."""
    listed = list(items)
    lines = [_cells(item) for item in listed[:rows]]
    table = Table(box=None, pad_edge=False, header_style="bold")
    shown = _fitting(lines, width)
    for heading in shown:
        table.add_column(
            heading,
            no_wrap=True,
            justify="right" if heading == "AGE" else "left",
            min_width=_NEVER_CUT.get(heading),
        )
    for line in lines:
        table.add_row(*(line[heading] for heading in shown))
    if len(lines) < len(listed):
        table.add_row(cell(f"… and {len(listed) - len(lines)} more", "dim"))
    return table


def _fitting(lines: list[dict[str, Text]], width: int) -> list[str]:
    """The headings there is room for: what can best be missed is left out first."""
    needed = {
        heading: _GAP + max([least, *(line[heading].cell_len for line in lines)])
        for heading, least in ((one, _NEVER_CUT.get(one, len(one))) for one in _HEADINGS)
    }
    shown = list(_HEADINGS)
    for dispensable in ("SOURCE", "NAME", "COMPONENT", "PROCESS"):
        if sum(needed[heading] for heading in shown) > width + _GAP:
            shown.remove(dispensable)
    return shown


def _cells(item: Item) -> dict[str, Text]:
    beacon = _beacon(item)
    state = _state(item)
    style = STATUS_STYLES.get(state, "")
    return {
        "ENTITY": cell(item["id"], "bold"),
        "STATUS": cell(state, style),
        "AGE": cell(duration(beacon["age_sec"]) if beacon else ""),
        "NAME": cell("" if item["name"] == item["id"] else item["name"]),
        "COMPONENT": cell(item.get("x-medkit", {}).get("component_id", "")),
        "PROCESS": cell(_process(beacon)),
        "SOURCE": cell(beacon.get("source", "")),
        "NOTE": cell(_note(beacon), style),
    }


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
    if beacon.get("status") == "left":
        notes.append("said goodbye")
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
