"""Looking around on a ROS network: what is seen, how long it takes, and what is left behind."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no network to look at")

from rclpy.context import Context
from rclpy.node import Node

from beacon_core.errors import ConfigError
from beacon_core.ports.examination import Finding, Level
from beacon_ros import examine as module
from beacon_ros import surroundings
from beacon_ros.domains import DomainLease
from beacon_ros.examine import (
    Look,
    common_findings,
    listed,
    looking,
    node_findings,
    visible_nodes,
)

pytestmark = pytest.mark.system

Start = Callable[..., Node]

ENOUGH_S = 20.0
NO_TIME_S = 0.2


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A domain of one's own; and no look at others, where other tests may be."""
    monkeypatch.setattr(module, "OTHER_DOMAINS", ())
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    with DomainLease() as lease:
        yield lease.domain_id


@pytest.fixture
def start() -> Iterator[Start]:
    """Starts a node on a domain."""
    with ExitStack() as stack:

        def make(name: str, domain_id: int) -> Node:
            context = Context()
            context.init(args=[], domain_id=domain_id, initialize_logging=False)
            stack.callback(context.try_shutdown)
            node = Node(name, context=context, use_global_arguments=False, enable_rosout=False)
            stack.callback(node.destroy_node)
            return node

        yield make


def test_it_looks_at_the_domain_it_is_told_to(domain: int) -> None:
    with looking(domain, NO_TIME_S) as look:
        assert look.domain_id == domain
        assert look.rmw.startswith("rmw_")
        assert visible_nodes(look.node) == ()


def test_otherwise_at_that_of_the_environment(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    with looking(None, NO_TIME_S) as look:
        assert look.domain_id == domain


@pytest.mark.parametrize("environment", ["300", "seven"])
def test_a_domain_that_cannot_be_joined_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, environment: str
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", environment)
    with pytest.raises(ConfigError) as caught, looking(None, NO_TIME_S):
        pass
    assert "\n" not in str(caught.value)


def test_nothing_is_left_behind_also_if_the_look_is_broken_off(domain: int) -> None:
    def threads() -> int:
        """Those of the middleware among them."""
        return sum(1 for _ in Path("/proc/self/task").iterdir())

    before = threads()
    with suppress(LookupError), looking(domain, NO_TIME_S):
        assert threads() > before
        raise LookupError
    deadline = time.monotonic() + ENOUGH_S
    while threads() > before:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_what_all_begin_with_is_told_before_anything_is_waited_for(domain: int) -> None:
    with looking(domain, ENOUGH_S) as look:
        found = list(common_findings(look, domain))
    assert [one.what.split()[0] for one in found[:2]] == ["ROS", "domain"]
    # How the tests keep ROS on this machine.
    assert "SYSTEM_DEFAULT" in found[2].what


def test_who_is_there_is_seen_long_before_time_is_up(domain: int, start: Start) -> None:
    start("talker", domain)
    began = time.monotonic()
    with looking(domain, ENOUGH_S) as look:
        seen = look.until_settled(lambda: visible_nodes(look.node))
    assert seen == ("/talker",)
    assert time.monotonic() - began < ENOUGH_S - 5


def test_who_comes_while_others_are_seen_is_waited_for(domain: int) -> None:
    news = itertools.chain([(), ("a",), ("a", "b")], itertools.repeat(("a", "b", "c")))
    with looking(domain, ENOUGH_S) as look:
        assert look.until_settled(lambda: next(news)) == ("a", "b", "c")


def test_where_nobody_comes_the_look_ends_when_time_is_up(domain: int) -> None:
    began = time.monotonic()
    with looking(domain, 0.5) as look:
        assert look.until_settled(lambda: visible_nodes(look.node)) == ()
    assert 0.5 <= time.monotonic() - began < 10


def test_hidden_nodes_are_nobody(domain: int, start: Start) -> None:
    start("_hidden", domain)
    start("talker", domain)
    with looking(domain, ENOUGH_S) as look:
        assert look.until_settled(lambda: visible_nodes(look.node)) == ("/talker",)


def fake_look(domain_id: int, node: Node) -> Look:
    return Look(node, domain_id, "rmw_x", NO_TIME_S)


def test_the_nodes_are_named_the_first_ones_at_least(domain: int, start: Start) -> None:
    look = fake_look(domain, start("talker", domain))
    assert list(node_findings(look, ["/b", "/a"])) == [
        Finding(Level.OK, f"2 nodes on domain {domain}: /a, /b")
    ]
    many = [f"/n{number}" for number in range(8)]
    (found,) = node_findings(look, many)
    assert found.what == f"8 nodes on domain {domain}: /n0, /n1, /n2, /n3, /n4 and 3 more"
    assert listed(["b", "a", "b"]) == "a, b"


@pytest.mark.parametrize("contained", [True, False])
def test_that_nobody_is_there_comes_with_everything_that_may_be_the_reason(
    domain: int,
    monkeypatch: pytest.MonkeyPatch,
    contained: bool,  # noqa: FBT001 - a parameter
) -> None:
    monkeypatch.setattr(surroundings, "in_container", lambda: contained)
    with looking(domain, NO_TIME_S) as look:
        nobody, *more = node_findings(look, [])
    assert (nobody.level, nobody.what) == (
        Level.PROBLEM,
        f"no node is seen on domain {domain}",
    )
    for word in ("ROS_DOMAIN_ID", look.rmw, "rmw_zenoh", "discovery range", "multicast", "UDP"):
        assert word in nobody.advice
    assert [one.what for one in more] == (["this is a container"] if contained else [])


def test_the_classic_mistake_is_found_out(
    domain: int, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(surroundings, "in_container", lambda: False)
    with closing(DomainLease()) as other:
        monkeypatch.setattr(module, "OTHER_DOMAINS", (other.domain_id,))
        monkeypatch.setattr(module, "_OTHERS_S", ENOUGH_S)
        start("talker", other.domain_id)
        with looking(domain, ENOUGH_S) as look:
            found = list(node_findings(look, []))
    assert found[1] == Finding(
        Level.NOTE,
        f"domain {other.domain_id} has 1 node: /talker",
        f"to hear them: domain_id: {other.domain_id} in the configuration, "
        f"or ROS_DOMAIN_ID={domain} there",
    )


def test_the_shells_domain_is_looked_at_too_where_the_configuration_has_another(
    domain: int, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(DomainLease()) as other:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(other.domain_id))
        monkeypatch.setattr(module, "_OTHERS_S", ENOUGH_S)
        start("talker", other.domain_id)
        with looking(domain, ENOUGH_S) as look:
            found = list(module.elsewhere(look, visible_nodes))
    assert [one.what for one in found] == [f"domain {other.domain_id} has 1 node: /talker"]


@pytest.mark.parametrize("environment", ["300", "seven", ""])
def test_a_domain_of_the_shell_that_cannot_be_is_left_out(
    domain: int, monkeypatch: pytest.MonkeyPatch, environment: str
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", environment)
    with looking(domain, NO_TIME_S) as look:
        assert list(module.elsewhere(look, visible_nodes)) == []
