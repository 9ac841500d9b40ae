"""As a client at the endpoints of a configuration, to see what there is; for every dialect.

Nothing is taken from a gateway that is running: neither the port at which it listens nor the
identity of its session.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import zenoh

from beacon_core.ports.examination import Finding, Level
from beacon_zenoh.config import SessionConfig
from beacon_zenoh.probe import place, why_no_tls, why_unreachable

__all__ = ["ANSWER_S", "LOOK_AGAIN_S", "channel", "listed", "section", "visit"]

ANSWER_S = 2.0
"""How long an answer may take. Of liveliness, all are there at once."""

LOOK_AGAIN_S = 0.25
"""Between one look and the next, while nobody is seen."""

_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104 - where others listen
"""Where to find somebody on this machine who listens on every address."""

_CONNECT_S = 2.0
_ROOM = 20_000
"""Answers that wait to be read. Zenoh's 256 are not enough for a fleet."""

_SHOWN = 5


def visit(
    config: SessionConfig, seconds: float, sessions: list[zenoh.Session]
) -> Iterator[Finding]:
    """Connect to each endpoint, and say what came of it. Sessions that came about are added to
    ``sessions``, which the caller closes."""
    own = [_from_here(one) for one in config.listen]
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


def channel() -> Any:
    """A handler that has room for a fleet's answers."""
    return zenoh.handlers.FifoChannel(_ROOM)


def section(config: SessionConfig, *path: str) -> Mapping[str, Any]:
    """A part of the configuration; empty if it is not given."""
    found: Any = config.document
    for key in path:
        found = found.get(key) or {}
    return found  # type: ignore[no-any-return]


def listed(names: set[str]) -> str:
    """The first few names, and how many more."""
    first = ", ".join(sorted(names)[:_SHOWN])
    return first if len(names) <= _SHOWN else f"{first} and {len(names) - _SHOWN} more"


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
        tls = section(config, "transport", "link", "tls")
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
    if section(config, "transport", "auth", "usrpwd"):
        return "check user and password at both ends; Zenoh does not say more"
    return "is it a Zenoh router at all, or does it want tls/, or a user? Zenoh does not say"


def _visitor(config: SessionConfig, endpoint: str) -> zenoh.Config:
    """The configuration of a client that is let in where the configured session belongs.

    Nothing else is taken over from it: not its id, its plugins, nor what it lets others do.
    """
    transport = dict(config.document["transport"])
    users = dict(section(config, "transport", "auth", "usrpwd"))
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
