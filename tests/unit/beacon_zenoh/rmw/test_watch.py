"""The graph over several sessions: who is there, who has gone, and tokens that nobody holds."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest
import zenoh

from beacon_zenoh.config import SessionConfig, session_config
from beacon_zenoh.harness import open_router
from beacon_zenoh.options import Mode, ZenohOptions
from beacon_zenoh.rmw import watch as module
from beacon_zenoh.rmw.session import node_member
from beacon_zenoh.rmw.tokens import Member, token_key
from beacon_zenoh.rmw.watch import (
    BACK_WITHIN_NS,
    DOUBTED_AFTER_NS,
    QUIET_NS,
    RENEWED_AFTER_NS,
    Watch,
)
from beacon_zenoh.session import SessionKeeper

IN_TIME_S = 10.0


class Notes:
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[str, str]] = []

    def came(self, key: str, member: Member, now_ns: int) -> None:
        self.told.append(("came", member.node))

    def came_again(self, key: str, now_ns: int) -> None:
        self.told.append(("again", key.rpartition("/")[2]))

    def went(self, key: str, member: Member, now_ns: int) -> None:
        self.told.append(("went", member.node))


class Keeper(SessionKeeper):
    """Keeps nothing: it is only asked."""

    def __init__(self, mode: Mode = "client") -> None:
        config = SessionConfig(mode, (), (), {})
        super().__init__(
            config, declare=lambda _: None, step=lambda _: None, farewell=lambda _: None
        )
        self.renewals = 0
        self._links = {"router"}

    def renew(self) -> None:
        self.renewals += 1


class World:
    """A router, and sessions of the test's own."""

    def __init__(self) -> None:
        self.router, self.endpoint = open_router()
        self.sessions: list[zenoh.Session] = [self.router]
        self.notes, self.keeper = Notes(), Keeper()
        self.watch = Watch([0], self.notes, self.keeper)

    def client(self) -> zenoh.Session:
        config = session_config(ZenohOptions(connect=(self.endpoint,)), "client")
        self.sessions.append(zenoh.open(config.make()))
        return self.sessions[-1]

    def begin(self) -> zenoh.Session:
        session = self.client()
        self.watch.begin(session, lambda _: None)
        return session

    def has(self, *names: str) -> Callable[[], bool]:
        return lambda: sorted(view.node.node for view in self.watch.graph.nodes()) == sorted(names)


def token_of(session: zenoh.Session, name: str, number: int = 0) -> zenoh.LivelinessToken:
    node = node_member(0, str(session.zid()), number, name)
    return session.liveliness().declare_token(token_key(node))


def within(predicate: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + IN_TIME_S
    while not predicate():
        assert time.monotonic() < deadline, f"not within {IN_TIME_S} s: {what}"
        time.sleep(0.005)


@pytest.fixture
def world() -> Iterator[World]:
    made = World()
    yield made
    for session in reversed(made.sessions):
        session.close()


def test_who_comes_and_goes_is_told_once(world: World) -> None:
    world.begin()
    token = token_of(world.client(), "talker")
    within(world.has("talker"), "it is there")
    token.undeclare()
    within(world.has(), "it has gone")
    assert world.notes.told == [("came", "talker"), ("went", "talker")]


def test_another_session_reports_again_who_is_there_and_sweeps_who_is_not(world: World) -> None:
    world.begin()
    keep = token_of(world.client(), "talker")
    within(world.has("talker"), "it is there")
    ghost = node_member(0, "dead", 0, "ghost")
    world.watch.graph.appeared(token_key(ghost))
    doubts: list[int] = []
    world.watch.begin(world.client(), doubts.append)
    within(lambda: ("again", "talker") in world.notes.told, "it is reported again")
    now_ns = time.monotonic_ns()
    assert 0 < doubts[0] - now_ns <= BACK_WITHIN_NS
    world.watch.step(now_ns)
    assert world.has("ghost", "talker")()
    world.watch.step(doubts[0])
    assert world.has("talker")()
    assert world.notes.told[-1] == ("went", "ghost")
    assert keep is not None


def test_what_an_old_session_still_has_to_tell_is_not_heard(world: World) -> None:
    old = world.begin()
    world.begin()
    token = token_of(world.client(), "talker")
    within(world.has("talker"), "it is there")
    old.close()
    assert world.has("talker")()
    assert [one for one in world.notes.told if one[0] == "came"] == [("came", "talker")]
    assert token is not None


# When another session is wanted


def due_after_ns(world: World, began_ns: int) -> int:
    found = world.watch.step(time.monotonic_ns() + BACK_WITHIN_NS)
    assert found is not None
    return found - began_ns


def test_a_session_is_replaced_when_it_is_old_and_sooner_if_there_is_a_suspicion(
    world: World,
) -> None:
    began_ns = time.monotonic_ns()
    world.begin()
    assert 0 <= due_after_ns(world, began_ns) - RENEWED_AFTER_NS < QUIET_NS
    world.watch.suspect()
    assert 0 <= due_after_ns(world, began_ns) - DOUBTED_AFTER_NS < QUIET_NS
    assert world.keeper.renewals == 0
    world.watch.step(began_ns + DOUBTED_AFTER_NS + QUIET_NS)
    assert world.keeper.renewals == 1
    world.begin()
    assert world.watch.step(time.monotonic_ns()) is not None
    assert world.keeper.renewals == 1


def test_if_there_is_none_to_be_had_it_is_tried_again_later(world: World) -> None:
    world.begin()
    now_ns = time.monotonic_ns() + RENEWED_AFTER_NS
    again_ns = world.watch.step(now_ns)
    assert world.keeper.renewals == 1
    assert again_ns is not None
    world.watch.step(again_ns - 1)
    assert world.keeper.renewals == 1
    world.watch.step(again_ns)
    assert world.keeper.renewals == 2


def test_questions_under_way_are_waited_for_but_not_for_ever(world: World) -> None:
    world.begin()
    now_ns = time.monotonic_ns() + RENEWED_AFTER_NS
    again_ns = world.watch.step(now_ns, busy=True)
    assert again_ns is not None
    assert now_ns < again_ns < now_ns + QUIET_NS
    assert world.keeper.renewals == 0
    world.watch.step(now_ns + 11 * QUIET_NS, busy=True)
    assert world.keeper.renewals == 1


def test_a_worn_session_is_replaced_as_soon_as_all_is_quiet(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "RENEW_AFTER", 3)
    world.begin()
    robot = world.client()
    for number in range(5):
        token_of(robot, f"n{number}", number).undeclare()
    within(lambda: world.notes.told.count(("went", "n4")) == 1, "all have gone")
    now_ns = time.monotonic_ns()
    world.watch.step(now_ns)
    assert world.keeper.renewals == 0
    world.watch.step(now_ns + QUIET_NS)
    assert world.keeper.renewals == 1


@pytest.mark.parametrize("mode", ["router", "peer"])
def test_who_listens_itself_keeps_its_session(mode: Mode) -> None:
    keeper = Keeper(mode)
    watch = Watch([0], Notes(), keeper)
    assert watch.step(time.monotonic_ns() + RENEWED_AFTER_NS) is None
    assert keeper.renewals == 0


def test_who_has_no_router_waits_for_it() -> None:
    keeper = Keeper()
    keeper._links = set()
    watch = Watch([0], Notes(), keeper)
    assert watch.step(time.monotonic_ns() + RENEWED_AFTER_NS) is None
    assert keeper.renewals == 0
