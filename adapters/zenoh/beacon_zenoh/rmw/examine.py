"""What can be seen of ROS over Zenoh: the router, the domains, the nodes, and who gives hints."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator

import zenoh

from beacon_core.ports.examination import Finding, Level
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.rmw.options import RmwOptions, RmwSessionOptions
from beacon_zenoh.rmw.session import rmw_session_config
from beacon_zenoh.rmw.tokens import Kind, Member, every_token, member_of
from beacon_zenoh.visit import ANSWER_S, LOOK_AGAIN_S, channel, listed, visit

__all__ = ["domain_findings", "examine", "members"]

_OURS = "_beacon_gateway_"
"""How the nodes of gateways are called: they are no robots."""


def examine(options: RmwOptions, seconds: float) -> Iterator[Finding]:
    """Look as a client. Raises ``ConfigError`` for what a source would refuse too."""
    config = rmw_session_config(options)
    sessions: list[zenoh.Session] = []
    try:
        yield from visit(config, seconds, sessions)
        if sessions:
            yield from _look(sessions[0], options, seconds)
    finally:
        for session in sessions:
            session.close()  # type: ignore[no-untyped-call]


def members(session: zenoh.Session) -> list[Member]:
    """All that is there, in any domain."""
    # Not with a callback: its thread would not end well if this program is interrupted.
    replies = session.liveliness().get(every_token(), channel(), timeout=ANSWER_S)
    found = [member_of(str(one.ok.key_expr)) for one in replies if one.ok is not None]
    return [member for member in found if member is not None]


def domain_findings(found: list[Member], options: RmwSessionOptions) -> Iterator[Finding]:
    """In which domains there are nodes, and which of them are listened to."""
    nodes = _nodes(found)
    counts = Counter(one.domain for one in nodes)
    # Somebody is there: then what else is missing may be meant so.
    level = Level.NOTE if counts.keys() & set(options.ros_domain_ids) else Level.PROBLEM
    for domain in options.ros_domain_ids:
        names = {one.node_name for one in nodes if one.domain == domain}
        if names:
            yield Finding(Level.OK, f"in ROS domain {domain}: {listed(names)}")
        else:
            yield Finding(
                level,
                f"no node is in ROS domain {domain}",
                "the robots need RMW_IMPLEMENTATION=rmw_zenoh_cpp, "
                f"ROS_DOMAIN_ID={domain}, and this router",
            )
    for domain in sorted(counts.keys() - set(options.ros_domain_ids)):
        wanted = ", ".join(map(str, (*options.ros_domain_ids, domain)))
        yield Finding(
            level,
            f"in ROS domain {domain}, which is not listened to: {_count(counts[domain])}",
            f"to hear them: ros_domain_ids: [{wanted}]",
        )


def _look(session: zenoh.Session, options: RmwOptions, seconds: float) -> Iterator[Finding]:
    """Who is there; until somebody publishes hints in one of our domains."""
    deadline = time.monotonic() + seconds
    while True:
        found = members(session)
        speakers = [one for one in found if _speaks(one, options)]
        if speakers or time.monotonic() > deadline:
            break
        time.sleep(LOOK_AGAIN_S)
    yield from domain_findings(found, options)
    if speakers:
        yield from _speakers(speakers, options)
    elif any(one.domain in options.ros_domain_ids for one in _nodes(found)):
        what = f"no node publishes on {options.topic}"
        advice = "start a beacon in one of them, or correct 'topic'"
        yield Finding(Level.PROBLEM, what, advice)


def _speaks(member: Member, options: RmwOptions) -> bool:
    return (
        member.kind is Kind.PUBLISHER
        and member.domain in options.ros_domain_ids
        and member.name == options.topic
    )


def _speakers(speakers: list[Member], options: RmwOptions) -> Iterator[Finding]:
    """Those who publish on the topic, by what becomes of their messages."""
    refused = {one.node_name for one in speakers if not options.admits(one.namespace)}
    heard = [one for one in speakers if options.admits(one.namespace)]
    good = {one.node_name for one in heard if one.type_name == TYPE_NAME}
    if good:
        yield Finding(Level.OK, f"hints on {options.topic} come from {listed(good)}")
    if refused:
        what = f"not heard, as their namespaces are not admitted: {listed(refused)}"
        yield Finding(Level.NOTE, what, "see 'namespaces' and 'except_namespaces'")
    for one in heard:
        if one.type_name != TYPE_NAME:
            what = f"{one.node_name} is not heard: it publishes {one.type_name}, not {TYPE_NAME}"
            yield Finding(Level.PROBLEM, what, "let it publish the hint, or use another topic")
        elif one.type_hash != TYPE_HASH:
            yield Finding(
                Level.NOTE,
                f"{one.node_name} has another definition of the message: {one.type_hash}",
                f"it is heard, but may be misread; ours is {TYPE_HASH}",
            )


def _nodes(found: list[Member]) -> list[Member]:
    return [one for one in found if one.kind is Kind.NODE and not one.node.startswith(_OURS)]


def _count(count: int) -> str:
    return "1 node" if count == 1 else f"{count} nodes"
