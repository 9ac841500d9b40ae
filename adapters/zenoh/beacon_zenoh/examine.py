"""What can be seen of the carrier: is the router there, does it let us in, and who announces."""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import zenoh

from beacon_core.ports.examination import Finding, Level
from beacon_core.validator import is_valid_id
from beacon_zenoh.config import SessionConfig, session_config
from beacon_zenoh.keys import Keys
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.visit import ANSWER_S, LOOK_AGAIN_S, channel, listed, section, visit

__all__ = ["examine"]

_ROOM = 20_000
"""Hints that wait to be read."""

_KEY = re.compile(r"(?P<prefix>.+)/(?:live|hint)/(?P<entity_id>[^/]+)(?:/[^/]+)?")

_Seen = dict[str, set[str]]
"""Entities by prefix."""


def examine(options: ZenohOptions, seconds: float) -> Iterator[Finding]:
    """Look as a client. Raises ``ConfigError`` for what a source would refuse too."""
    config = session_config(options, "router")
    sessions: list[zenoh.Session] = []
    try:
        yield from visit(config, seconds, sessions)
        if sessions:
            yield from _who(sessions[0], config, options.prefix, seconds)
    finally:
        for session in sessions:
            session.close()  # type: ignore[no-untyped-call]


def _who(
    session: zenoh.Session, config: SessionConfig, prefix: str, seconds: float
) -> Iterator[Finding]:
    """Who announces, under which prefix; until somebody is seen under ours."""
    heard: _Seen = defaultdict(set)
    # Not with callbacks: their threads would not end well if this program is interrupted.
    hints = session.declare_subscriber("**/hint/*", zenoh.handlers.RingChannel(_ROOM))
    deadline = time.monotonic() + seconds
    while True:
        tokens = _answers(session.liveliness().get("**/live/**", channel(), timeout=ANSWER_S))
        while (sample := hints.try_recv()) is not None:
            _enlist(heard, str(sample.key_expr))
        if tokens[prefix] or heard[prefix] or time.monotonic() > deadline:
            break
        time.sleep(LOOK_AGAIN_S)
    answered = _ask(session, prefix)
    present = tokens[prefix] | heard[prefix] | answered
    if present:
        yield Finding(Level.OK, f"under the prefix {prefix!r}: {listed(present)}")
    if mute := tokens[prefix] - answered:
        what = f"connected, but not saying what they are when asked: {listed(mute)}"
        yield Finding(Level.NOTE, what, "they may hang, or have nothing that answers")
    others = {one: tokens[one] | heard[one] for one in (*tokens, *heard) if one != prefix}
    if not present and not any(others.values()):
        yield _nobody(config, prefix)
    for other, seen in others.items():
        yield Finding(
            Level.NOTE if present else Level.PROBLEM,
            f"under another prefix, {other!r}, and so not heard: {listed(seen)}",
            f"to hear them: prefix: {other} here, or prefix: {prefix} there",
        )


def _ask(session: zenoh.Session, prefix: str) -> set[str]:
    """Who says its hint when asked."""
    replies = session.get(
        Keys(prefix).hints,
        channel(),
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=ANSWER_S,
    )
    return _answers(replies)[prefix]


def _nobody(config: SessionConfig, prefix: str) -> Finding:
    what = f"nobody announces under the prefix {prefix!r}, nor under another"
    if section(config, "access_control").get("enabled"):
        advice = "see what the running gateway has counted: nothing is hidden from it"
        return Finding(Level.NOTE, f"{what}, as far as access control lets us see", advice)
    advice = f"try: beacon announce --entity-id test --option prefix={prefix} --connect ENDPOINT"
    return Finding(Level.PROBLEM, what, advice)


def _answers(replies: Any) -> _Seen:
    found: _Seen = defaultdict(set)
    for reply in replies:
        if reply.ok is not None:
            _enlist(found, str(reply.ok.key_expr))
    return found


def _enlist(found: _Seen, key: str) -> None:
    named = _KEY.fullmatch(key)
    if named and is_valid_id(named["entity_id"]):
        found[named["prefix"]].add(named["entity_id"])
