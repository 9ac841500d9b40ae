"""What can be seen of the carrier: is the router there, does it let us in, and who announces.

Looked at as a client, so that nothing is taken from a gateway that is running: neither the port at
which it listens nor the identity of its session.
"""

from __future__ import annotations

import re
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import zenoh

from beacon_core.ports.examination import Finding, Level
from beacon_core.validator import is_valid_id
from beacon_zenoh.config import SessionConfig, session_config
from beacon_zenoh.keys import Keys
from beacon_zenoh.options import ZenohOptions
from beacon_zenoh.probe import place, why_no_tls, why_unreachable

__all__ = ["examine"]

_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - where others listen
"""Where to find somebody on this machine who listens on every address."""

_CONNECT_S = 2.0
_ANSWER_S = 2.0
_LOOK_AGAIN_S = 0.25
_ROOM = 20_000
"""Answers that wait to be read. Zenoh's 256 are not enough for a fleet."""

_SHOWN = 5

_KEY = re.compile(r"(?P<prefix>.+)/(?:live|hint)/(?P<entity_id>[^/]+)(?:/[^/]+)?")

_Seen = dict[str, set[str]]
"""Entities by prefix."""


def examine(options: ZenohOptions, seconds: float) -> Iterator[Finding]:
    """Look as a client. Raises ``ConfigError`` for what a source would refuse too."""
    config = session_config(options, "router")
    own = [_from_here(one) for one in config.listen]
    sessions: list[zenoh.Session] = []
    try:
        for endpoint in dict.fromkeys([*own, *map(_from_here, config.connect)]):
            if endpoint.endswith(":0"):
                yield _unknowable(endpoint)
                continue
            entered = _enter(endpoint, config, seconds, own=endpoint in own)
            if isinstance(entered, Finding):
                yield entered
            else:
                sessions.append(entered)
                yield Finding(Level.OK, f"{endpoint}: connected")
        if sessions:
            yield from _who(sessions[0], config, options.prefix, seconds)
    finally:
        for session in sessions:
            session.close()  # type: ignore[no-untyped-call]


def _from_here(endpoint: str) -> str:
    """The endpoint as somebody on this machine would connect to it."""
    at = place(endpoint)
    if at is None or at.host not in _EVERYWHERE:
        return endpoint
    host = _EVERYWHERE[at.host]
    return f"{at.protocol}/{f'[{host}]' if ':' in host else host}:{at.port}"


def _unknowable(endpoint: str) -> Finding:
    what = f"{endpoint}: the system chooses the port, so nobody can be asked there"
    return Finding(Level.NOTE, what, "give a port in 'listen' to have it looked at")


def _enter(
    endpoint: str, config: SessionConfig, seconds: float, *, own: bool
) -> zenoh.Session | Finding:
    """A session at this endpoint; or why there is none."""
    at = place(endpoint)
    within_s = min(_CONNECT_S, seconds)
    if at is not None and (why := why_unreachable(at, within_s)):
        advice = "start the router there, or correct 'connect'"
        if own:
            advice = "start the gateway (beacon run): there it is the router itself"
        return Finding(Level.PROBLEM, f"{endpoint}: {why}", advice)
    try:
        return zenoh.open(_visitor(config, endpoint))
    except zenoh.ZError:
        pass  # its words say nothing
    if at is not None and at.protocol == "tls":
        tls = _section(config, "transport", "link", "tls")
        if own and not tls.get("root_ca_certificate"):
            return _unproven(endpoint)
        if why := why_no_tls(at, tls, within_s):
            advice = "check ca, certificate and key at both ends; was it reached by its own name?"
            return Finding(Level.PROBLEM, f"{endpoint}: {why}", advice)
    return Finding(Level.PROBLEM, f"{endpoint}: it answers, but lets us not in", _advice(config))


def _unproven(endpoint: str) -> Finding:
    what = f"{endpoint}: it answers; without a ca this configuration cannot prove by whom"
    return Finding(Level.NOTE, what, "look with the configuration of a robot, which has one")


def _advice(config: SessionConfig) -> str:
    if _section(config, "transport", "auth", "usrpwd"):
        return "check user and password at both ends; Zenoh does not say more"
    return "is it a Zenoh router at all, or does it want tls/, or a user? Zenoh does not say"


def _visitor(config: SessionConfig, endpoint: str) -> zenoh.Config:
    """The configuration of a client that is let in where the configured session belongs.

    Nothing else is taken over from it: not its id, its plugins, nor what it lets others do.
    """
    transport = dict(config.document["transport"])
    users = dict(_section(config, "transport", "auth", "usrpwd"))
    if users:
        transport["auth"] = {"usrpwd": _user(**users)}
    document = {
        "mode": "client",
        "scouting": config.document["scouting"],
        "transport": transport,
        "connect": {**config.document["connect"], "endpoints": [endpoint]},
    }
    return SessionConfig("client", (endpoint,), (), document).make()


def _user(user: str = "", password: str = "", dictionary_file: str = "") -> dict[str, str]:
    """Who to be: a router knows users without being one, so the first of them looks."""
    if dictionary_file and not user:
        first = Path(dictionary_file).read_text("utf-8").partition("\n")[0]
        user, _, password = first.strip().partition(":")
    return {"user": user, "password": password}


def _who(
    session: zenoh.Session, config: SessionConfig, prefix: str, seconds: float
) -> Iterator[Finding]:
    """Who announces, under which prefix; until somebody is seen under ours."""
    heard: _Seen = defaultdict(set)
    # Not with callbacks: their threads would not end well if this program is interrupted.
    hints = session.declare_subscriber("**/hint/*", zenoh.handlers.RingChannel(_ROOM))
    deadline = time.monotonic() + seconds
    while True:
        tokens = _answers(session.liveliness().get("**/live/**", _channel(), timeout=_ANSWER_S))
        while (sample := hints.try_recv()) is not None:
            _enlist(heard, str(sample.key_expr))
        if tokens[prefix] or heard[prefix] or time.monotonic() > deadline:
            break
        time.sleep(_LOOK_AGAIN_S)
    answered = _ask(session, prefix)
    present = tokens[prefix] | heard[prefix] | answered
    if present:
        yield Finding(Level.OK, f"under the prefix {prefix!r}: {_listed(present)}")
    if mute := tokens[prefix] - answered:
        what = f"connected, but not saying what they are when asked: {_listed(mute)}"
        yield Finding(Level.NOTE, what, "they may hang, or have nothing that answers")
    others = {one: tokens[one] | heard[one] for one in (*tokens, *heard) if one != prefix}
    if not present and not any(others.values()):
        yield _nobody(config, prefix)
    for other, seen in others.items():
        yield Finding(
            Level.NOTE if present else Level.PROBLEM,
            f"under another prefix, {other!r}, and so not heard: {_listed(seen)}",
            f"to hear them: prefix: {other} here, or prefix: {prefix} there",
        )


def _ask(session: zenoh.Session, prefix: str) -> set[str]:
    """Who says its hint when asked."""
    replies = session.get(
        Keys(prefix).hints,
        _channel(),
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=_ANSWER_S,
    )
    return _answers(replies)[prefix]


def _nobody(config: SessionConfig, prefix: str) -> Finding:
    what = f"nobody announces under the prefix {prefix!r}, nor under another"
    if _section(config, "access_control").get("enabled"):
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


def _channel() -> Any:
    return zenoh.handlers.FifoChannel(_ROOM)


def _section(config: SessionConfig, *path: str) -> Mapping[str, Any]:
    section: Any = config.document
    for key in path:
        section = section.get(key) or {}
    return section  # type: ignore[no-any-return]


def _listed(names: set[str]) -> str:
    first = ", ".join(sorted(names)[:_SHOWN])
    return first if len(names) <= _SHOWN else f"{first} and {len(names) - _SHOWN} more"
