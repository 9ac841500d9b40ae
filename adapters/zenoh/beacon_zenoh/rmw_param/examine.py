"""What can be seen of the nodes over Zenoh: who can be asked, who answers, what they declare."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import zenoh

from beacon_core.parameters.examination import Declared, declarations
from beacon_core.parameters.fields import MAX_PARAMETERS, PREFIX, is_ours
from beacon_core.ports.examination import Finding, Level
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.examine import domain_findings, members
from beacon_zenoh.rmw.graph import Graph
from beacon_zenoh.rmw.session import rmw_session_config
from beacon_zenoh.rmw.tokens import Member, token_key
from beacon_zenoh.rmw_param import messages
from beacon_zenoh.rmw_param.clients import MAX_ANSWER_BYTES, ask
from beacon_zenoh.rmw_param.options import RmwParamOptions
from beacon_zenoh.rmw_param.roll import Roll
from beacon_zenoh.visit import LOOK_AGAIN_S, channel, listed, visit

__all__ = ["examine"]

_ANSWER_S = 4.0
"""Where ``timeout_s`` is longer, an examination does not wait as long as a source would."""

_MAX_ASKED = 500
"""Nodes of which parameters are asked."""


def examine(options: RmwParamOptions, seconds: float) -> Iterator[Finding]:
    """Look as a client, and ask each node as a source would.

    Raises ``ConfigError`` for what a source would refuse too.
    """
    config = rmw_session_config(options)
    sessions: list[zenoh.Session] = []
    try:
        yield from visit(config, seconds, sessions)
        if sessions:
            yield from _look(sessions[0], options, seconds)
    finally:
        for session in sessions:
            session.close()  # type: ignore[no-untyped-call]


def _look(session: zenoh.Session, options: RmwParamOptions, seconds: float) -> Iterator[Finding]:
    deadline = time.monotonic() + seconds
    while True:
        found = members(session)
        roll, runs = _called(found, options)
        wanted = roll.named(options.targets) if options.targets else roll.visible()
        askable = [name for name in wanted if name in roll.doors]
        if askable or time.monotonic() > deadline:
            break
        time.sleep(LOOK_AGAIN_S)
    yield from domain_findings(found, options)
    if missing := set(roll.missing(options.targets)):
        what = f"among the targets, but not there: {listed(missing)}"
        yield Finding(Level.PROBLEM, what, "start them, or write them as 'ros2 node list' does")
    if mute := {name for name in wanted if name in runs} - set(askable):
        what = f"without parameter services, and so not asked: {listed(mute)}"
        yield Finding(Level.NOTE, what, "start_parameter_services is off in such a node")
    if twins := {name for name in wanted if len(runs.get(name, ())) > 1}:
        what = f"the name of several nodes each: {listed(twins)}"
        yield Finding(Level.NOTE, what, "rename them; or one is a ghost, which goes within minutes")
    if askable:
        within_s = min(options.timeout_s, _ANSWER_S)
        yield from declarations(_ask(session, roll, askable[:_MAX_ASKED], within_s), within_s)


def _called(found: list[Member], options: RmwParamOptions) -> tuple[Roll, Mapping[str, Any]]:
    graph, roll = Graph(), Roll(options)
    for member in found:
        if member.domain in options.ros_domain_ids:
            graph.appeared(token_key(member))
    return roll, roll.call(graph, 0)


def _ask(
    session: zenoh.Session, roll: Roll, names: list[str], within_s: float
) -> dict[str, Declared | None]:
    """What each declares; ``None``: it did not answer in time."""
    everything = messages.encode_list_request(messages.ListRequest((PREFIX,)))
    lists = _call(
        session,
        {roll.doors[name].list_key: everything for name in names},
        messages.decode_list_response,
        within_s,
    )
    ours = {
        name: [one for one in answer if is_ours(one)][:MAX_PARAMETERS]
        for name in names
        if (answer := lists.get(roll.doors[name].list_key)) is not None
    }
    values = _call(
        session,
        {
            roll.doors[name].get_key: messages.encode_names(some)
            for name, some in ours.items()
            if some
        },
        messages.decode_values,
        within_s,
    )
    declared: dict[str, Declared | None] = dict.fromkeys(names)
    for name, some in ours.items():
        answer = values.get(roll.doors[name].get_key)
        if not some:
            declared[name] = {}
        elif answer is not None:
            declared[name] = dict(zip(some, answer, strict=False))
    return declared


def _call(
    session: zenoh.Session,
    requests: Mapping[str, bytes],
    decode: Callable[[bytes], list[Any] | None],
    within_s: float,
) -> dict[str, list[Any]]:
    """All at once, by key; the answers of those who answer in time."""
    gid = secrets.token_bytes(attachment.GID_BYTES)
    asked = []
    for number, (key, request) in enumerate(requests.items(), start=1):
        beside = attachment.encode(gid, number, time.time_ns())
        asked.append((key, ask(session, key, request, beside, channel(), within_s)))
    answers = {}
    for key, replies in asked:
        for reply in replies:
            if reply.ok is not None and len(reply.ok.payload) <= MAX_ANSWER_BYTES:
                answer = decode(reply.ok.payload.to_bytes())
                if answer is not None:
                    answers[key] = answer
    return answers
