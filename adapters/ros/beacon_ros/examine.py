"""What can be seen of a ROS network from here: what both adapters' examinations begin with.

Everything is seen by a hidden node of our own, so nothing is asked of a gateway that may be running
in another process, and nothing is changed.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import TypeVar

import attrs
from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier

from beacon_core.errors import ConfigError
from beacon_core.ports.examination import Finding, Level
from beacon_ros import surroundings
from beacon_ros.environment import MAX_DOMAIN
from beacon_ros.graph import node_names
from beacon_ros.participant import OwnNode

__all__ = [
    "OTHER_DOMAINS",
    "Look",
    "common_findings",
    "elsewhere",
    "listed",
    "looking",
    "node_findings",
    "visible_nodes",
]

OTHER_DOMAINS = range(6)
"""Where else to look when there is nothing to be seen: 0 is the default, and whoever takes another
tends to begin at 1. A participant in each costs 8 ms to make and 40 ms of CPU to hold."""

_SHOWN = 5
_POLL_S = 0.05
_SETTLED_S = 3.0
"""Discovery brings most within 0.1 s, and now and then something only with the next heartbeat of
Fast DDS, 3 s later: with 1 s, one look in ten of a test missed one node of seven."""

_OTHERS_S = 3.0

_Seen = TypeVar("_Seen", bound=Hashable)


@attrs.frozen(eq=False)
class Look:
    """A node that looks around for some seconds. Thread rule: one thread."""

    node: Node
    domain_id: int
    rmw: str
    seconds: float

    def until_settled(self, see: Callable[[], _Seen]) -> _Seen:
        """What is seen, once there is something and it no longer changes, or time is up."""
        deadline = time.monotonic() + self.seconds
        seen, since = see(), time.monotonic()
        while (now := time.monotonic()) < deadline and not (seen and now - since >= _SETTLED_S):
            time.sleep(_POLL_S)
            before, seen = seen, see()
            if seen != before:
                since = time.monotonic()
        return seen


@contextmanager
def looking(domain_id: int | None, seconds: float) -> Iterator[Look]:
    """Look around on this domain (``None``: the environment's) for about so many seconds.

    Raises ``ConfigError`` if it cannot be joined.
    """
    own = _join(domain_id)
    try:
        rmw = get_rmw_implementation_identifier()
        yield Look(own.node, own.context.get_domain_id(), rmw, seconds)
    finally:
        own.close()


def visible_nodes(node: Node) -> tuple[str, ...]:
    """The full names of all nodes but the hidden ones, such as this one."""
    return tuple(name for name in node_names(node) if "/_" not in name)


def common_findings(look: Look, configured_domain: int | None) -> Iterator[Finding]:
    """Which ROS this is and how far it sees; told before anything is waited for."""
    yield surroundings.which_ros(look.rmw)
    yield surroundings.domain(configured_domain, look.domain_id, os.environ)
    yield from surroundings.range_findings(os.environ)


def node_findings(look: Look, nodes: Collection[str]) -> Iterator[Finding]:
    """Who is there; or, if nobody is, what may be the reason, and who is on other domains."""
    if nodes:
        what = f"{_count(nodes, 'node')} on domain {look.domain_id}: {listed(nodes)}"
        yield Finding(Level.OK, what)
        return
    yield Finding(
        Level.PROBLEM,
        f"no node is seen on domain {look.domain_id}",
        f"is one running? Then compare ROS_DOMAIN_ID, RMW_IMPLEMENTATION ({look.rmw} here: DDS "
        "and rmw_zenoh do not hear each other) and discovery range at both ends; and let "
        f"multicast and UDP {surroundings.domain_ports(look.domain_id)} through firewalls",
    )
    yield from elsewhere(look, visible_nodes)
    if surroundings.in_container():
        advice = "docker needs --net=host to see others, and --ipc=host to hear those on its host"
        yield Finding(Level.NOTE, "this is a container", advice)


def elsewhere(
    look: Look, see: Callable[[Node], Collection[str]], doing: str = ""
) -> Iterator[Finding]:
    """Whom ``see`` sees on the other domains that people use; ``doing`` says what they do."""
    domains = {one for one in (*OTHER_DOMAINS, _shells_domain()) if one is not None}
    possible = sorted(one for one in domains - {look.domain_id} if one <= MAX_DOMAIN)
    with ExitStack() as stack:
        others = {one: stack.enter_context(closing(_join(one))) for one in possible}
        deadline = time.monotonic() + min(_OTHERS_S, look.seconds)
        while not any(see(own.node) for own in others.values()):
            if time.monotonic() > deadline:
                return
            time.sleep(_POLL_S)
        # What is seen first is seldom all.
        time.sleep(_POLL_S * 4)
        for domain_id, own in others.items():
            if names := see(own.node):
                yield Finding(
                    Level.NOTE,
                    f"domain {domain_id} has {_count(names, 'node')}{doing}: {listed(names)}",
                    f"to hear them: domain_id: {domain_id} in the configuration, "
                    f"or ROS_DOMAIN_ID={look.domain_id} there",
                )


def listed(names: Iterable[str]) -> str:
    """The first of the names, and how many more there are."""
    everybody = sorted(set(names))
    more = len(everybody) - _SHOWN
    return ", ".join(everybody[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


def _join(domain_id: int | None) -> OwnNode:
    shells = _shells_domain()
    if domain_id is None and shells is not None and shells > MAX_DOMAIN:
        # Fast DDS does not refuse it: it ends the process.
        raise ConfigError(f"ROS_DOMAIN_ID is {shells}; set it to 0 to {MAX_DOMAIN}, or unset it")
    return OwnNode("doctor", domain_id)


def _shells_domain() -> int | None:
    named = os.environ.get("ROS_DOMAIN_ID", "")
    return int(named) if named.isascii() and named.isdigit() else None


def _count(names: Collection[str], thing: str) -> str:
    return f"{len(names)} {thing}{'' if len(names) == 1 else 's'}"
