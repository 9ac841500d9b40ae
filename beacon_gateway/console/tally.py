"""What a running gateway has counted, in words: who was heard, and what was turned away and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from beacon_core.outcome import Verdict
from beacon_core.ports.examination import Finding, Level
from beacon_gateway.vendor import BEACON

__all__ = ["findings"]

_Body = Mapping[str, Any]

_TO_BEGIN_S = 10.0
"""A source that asks in turns, on a network that is discovered slowly, may hear nothing before."""

_TURNED_AWAY: Mapping[Verdict, tuple[str, str]] = {
    Verdict.SOURCE_RATE: (
        "dropped by source_rate",
        "raise source_rate or slow the sender: so many a second are taken from each",
    ),
    Verdict.GLOBAL_RATE: (
        "dropped by global_rate",
        "raise global_rate or slow the senders: so many a second are taken from all together",
    ),
    Verdict.STORE_FULL: (
        "dropped because there was no room for another entity",
        "raise max_hints, or find out who makes up ids",
    ),
    Verdict.TOO_LARGE: ("rejected as too large", "shorten what the sender says of itself"),
    Verdict.MALFORMED: (
        "rejected: no hint in this carrier's format",
        "find out who sends them: another version or another program (the gateway's log knows)",
    ),
    Verdict.INVALID: (
        "rejected: no entity_id, or one that the sender may not use",
        "give one of 1 to 256 characters of A-Z a-z 0-9 _ - (the gateway's log names the sender)",
    ),
    Verdict.FAULT: ("rejected by a defect of the decoder", "please report it"),
}
"""What became of a message, and what to do about it. The others are everyday."""


def findings(before: _Body, after: _Body, configured: Iterable[str]) -> Iterator[Finding]:
    """What two answers of ``/health`` tell, a few seconds apart, about these sources.

    What is still being turned away between the two is a problem; what was, is not any more.
    """
    earlier, sources = _sources(before), _sources(after)
    uptime_s = after[BEACON]["uptime_sec"]
    for name in configured:
        if name not in sources:
            yield Finding(
                Level.NOTE,
                f"{name}: the running gateway has no such source",
                "it runs with another configuration: restart it with this one",
            )
    for name, source in sources.items():
        yield from _source(name, source, earlier.get(name, source), uptime_s)


def _sources(body: _Body) -> dict[str, _Body]:
    return {source["name"]: source for source in body[BEACON]["sources"]}


def _source(name: str, source: _Body, earlier: _Body, uptime_s: float) -> Iterator[Finding]:
    if source["condition"] != "up":
        what = f"{name}: {source['condition']}"
        detail = source.get("detail", "")
        yield Finding(Level.PROBLEM, f"{what}: {detail}" if detail else what)
    yield _heard(name, source, uptime_s)
    hints, counts = source["hints"], source["messages"]
    for verdict, (what, advice) in _TURNED_AWAY.items():
        count = counts.get(verdict, 0)
        new = count - earlier["messages"].get(verdict, 0)
        if count:
            grave = new > 0 or not hints["active"]
            lately = f", {new} of them just now" if new > 0 else ""
            yield Finding(
                Level.PROBLEM if grave else Level.NOTE,
                f"{name}: {_many(count, 'message')} {what}{lately}",
                advice,
            )
    if hints["conflicts"]:
        yield Finding(
            Level.NOTE,
            f"{name}: {_many(hints['conflicts'], 'id')} claimed by two processes at a time",
            "give each an entity_id of its own; 'beacon get' shows who they are",
        )


def _heard(name: str, source: _Body, uptime_s: float) -> Finding:
    hints = source["hints"]
    if not any(source["messages"].values()):
        return Finding(
            Level.PROBLEM if uptime_s >= _TO_BEGIN_S else Level.NOTE,
            f"{name}: nothing has arrived since the gateway started {uptime_s:.0f} s ago",
            "see what was found on its carrier, above; and the gateway's log",
        )
    what = (
        f"{name}: {_many(source['senders'], 'sender')}; {hints['active']} active, "
        f"{hints['stale']} stale, {hints['left']} left"
    )
    if hints["active"] or hints["left"]:
        return Finding(Level.OK, what)
    return Finding(Level.PROBLEM, what, "whoever was heard is silent now: are they running?")


def _many(count: int, thing: str) -> str:
    return f"{count} {thing}{'' if count == 1 else 's'}"
