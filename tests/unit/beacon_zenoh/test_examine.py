"""An empty view explained: routers, doors and announcers as they are in truth."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest
import zenoh

from beacon_core.hint import BeaconHint
from beacon_core.ports.examination import Finding, Level
from beacon_core.testing.waiting import wait_until
from beacon_zenoh import ADAPTER, TlsOptions, ZenohOptions
from beacon_zenoh import visit as module
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.config import session_config
from beacon_zenoh.examine import examine
from beacon_zenoh.harness import free_endpoint, open_router
from beacon_zenoh.keys import Keys

if TYPE_CHECKING:
    from tests.unit.beacon_zenoh.conftest import Papers

LOOK_S = 5.0
NO_TIME_S = 0.3
"""For what is not there: looking longer would not find it."""


class Plant:
    """Routers and announcers that end with the test."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._routers: dict[str, zenoh.Session] = {}

    def router(self, **options: Any) -> str:
        """A router with these options; where it listens."""
        session, endpoint = open_router(ZenohOptions(**options))
        return self._with(session, endpoint)

    def tls_router(self, tls: TlsOptions) -> str:
        endpoint = free_endpoint().replace("tcp/", "tls/")
        options = ZenohOptions(listen=(endpoint,), tls=tls)
        return self._with(zenoh.open(session_config(options, "router").make()), endpoint)

    def _with(self, router: zenoh.Session, endpoint: str) -> str:
        self._stack.callback(router.close)
        self._routers[endpoint] = router
        return endpoint

    def announce(self, endpoint: str, *names: str, heard: bool = True, **options: Any) -> None:
        """Announce these, and return when the router has heard of them, unless it will not."""
        mine = ZenohOptions(connect=(endpoint,), **options)
        announcer = ZenohAnnouncer(mine, 0.2)
        self._stack.callback(announcer.close)
        for name in names:
            announcer.announce(BeaconHint(name))
        keys = Keys(mine.prefix)

        def answered() -> set[str]:
            # Who can be asked is declared last.
            replies = self._routers[endpoint].get(keys.hints, zenoh.handlers.FifoChannel(1000))
            return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}

        if heard:
            assert wait_until(lambda: answered() >= {keys.hint(name) for name in names}, 30.0)

    def client(self, endpoint: str) -> zenoh.Session:
        options = ZenohOptions(mode="client", connect=(endpoint,))
        session = zenoh.open(session_config(options, "client").make())
        self._stack.callback(session.close)
        return session


@pytest.fixture
def plant() -> Iterator[Plant]:
    with ExitStack() as stack:
        yield Plant(stack)


def look(seconds: float = LOOK_S, **options: Any) -> list[Finding]:
    assert ADAPTER.examine is not None
    return list(ADAPTER.examine(ZenohOptions(**options), seconds))


def told(found: list[Finding]) -> list[tuple[Level, str]]:
    return [(one.level, one.what) for one in found]


def until(*expected: tuple[Level, str], **options: Any) -> list[Finding]:
    """Looks again until it is told just this: what is on its way may come one by one."""
    deadline = time.monotonic() + 10
    while told(found := look(0.5, **options)) != [*expected] and time.monotonic() < deadline:
        pass
    assert told(found) == [*expected]
    return found


def test_who_announces_is_listed(plant: Plant) -> None:
    endpoint = plant.router()
    plant.announce(endpoint, "lidar", "arm")
    until(
        (Level.OK, f"{endpoint}: connected"),
        (Level.OK, "under the prefix 'beacon': arm, lidar"),
        listen=(endpoint,),
    )


def test_the_look_ends_as_soon_as_somebody_is_seen(plant: Plant) -> None:
    endpoint = plant.router()
    plant.announce(endpoint, "lidar")
    began = time.monotonic()
    assert look(60, listen=(endpoint,))[-1].level is Level.OK
    assert time.monotonic() - began < 20


def test_of_many_the_first_are_named(plant: Plant) -> None:
    endpoint = plant.router()
    plant.announce(endpoint, *(f"e{number:02}" for number in range(300)))
    until(
        (Level.OK, f"{endpoint}: connected"),
        (Level.OK, "under the prefix 'beacon': e00, e01, e02, e03, e04 and 295 more"),
        listen=(endpoint,),
    )


def test_without_a_gateway_it_says_to_start_one(plant: Plant) -> None:
    endpoint = free_endpoint()
    (finding,) = look(NO_TIME_S, listen=(endpoint,))
    assert told([finding]) == [(Level.PROBLEM, f"{endpoint}: nobody listens there")]
    assert "beacon run" in finding.advice


def test_without_a_router_a_client_is_told_to_start_it_or_to_look_elsewhere() -> None:
    endpoint = free_endpoint()
    (finding,) = look(NO_TIME_S, mode="client", connect=(endpoint,))
    assert finding.advice == "start the router there, or correct 'connect'"


def test_each_endpoint_is_tried_and_one_is_enough_to_look(plant: Plant) -> None:
    here, nowhere = plant.router(), free_endpoint()
    plant.announce(here, "arm")
    found = look(mode="client", connect=(nowhere, here))
    assert [one.level for one in found] == [Level.PROBLEM, Level.OK, Level.OK]


def test_who_listens_everywhere_is_looked_for_here(plant: Plant) -> None:
    port = plant.router().rpartition(":")[2]
    found = look(NO_TIME_S, listen=(f"tcp/0.0.0.0:{port}", f"tcp/[::]:{port}"))
    assert found[0] == Finding(Level.OK, f"tcp/127.0.0.1:{port}: connected")
    assert found[1].what.startswith(f"tcp/[::1]:{port}: ")


def test_a_port_that_the_system_chooses_cannot_be_looked_at() -> None:
    (finding,) = look(mode="peer")
    assert finding.level is Level.NOTE
    assert "the system chooses the port" in finding.what


def test_it_does_not_stand_in_the_way_of_a_gateway(plant: Plant) -> None:
    """Neither the port nor the name of its session is taken."""
    config = {"id": "abc123", "metadata": {"name": "gateway"}}
    endpoint = plant.router(config=config)
    plant.announce(endpoint, "arm")
    assert look(listen=(endpoint,), config=config)[-1].level is Level.OK


def test_nobody_at_all_is_a_problem_with_something_to_try(plant: Plant) -> None:
    found = look(NO_TIME_S, listen=(plant.router(),), prefix="plant_7")
    assert told(found[1:]) == [
        (Level.PROBLEM, "nobody announces under the prefix 'plant_7', nor under another")
    ]
    assert "--option prefix=plant_7" in found[1].advice


def test_those_under_another_prefix_are_pointed_out(plant: Plant) -> None:
    endpoint = plant.router()
    plant.announce(endpoint, "arm", prefix="plant/b")
    found = until(
        (Level.OK, f"{endpoint}: connected"),
        (Level.PROBLEM, "under another prefix, 'plant/b', and so not heard: arm"),
        listen=(endpoint,),
    )
    assert found[1].advice == "to hear them: prefix: plant/b here, or prefix: beacon there"
    # Where somebody is heard, it may be meant so.
    plant.announce(endpoint, "lidar")
    until(
        (Level.OK, f"{endpoint}: connected"),
        (Level.OK, "under the prefix 'beacon': lidar"),
        (Level.NOTE, "under another prefix, 'plant/b', and so not heard: arm"),
        listen=(endpoint,),
    )


def test_who_has_only_hints_to_show_is_seen_with_the_next_one(plant: Plant) -> None:
    endpoint = plant.router()
    speaker, stop = plant.client(endpoint), threading.Event()

    def speak() -> None:
        while not stop.wait(0.05):
            speaker.put("beacon/hint/plain", b"{}")
            speaker.put("beacon/hint/no id", b"{}")

    thread = threading.Thread(target=speak)
    thread.start()
    found = look(listen=(endpoint,))
    stop.set()
    thread.join()
    assert told(found[1:]) == [(Level.OK, "under the prefix 'beacon': plain")]


def test_who_is_connected_but_does_not_answer_is_named(plant: Plant) -> None:
    endpoint = plant.router()
    mute = plant.client(endpoint)
    keys = ("beacon/live/mute/run", "beacon/live/no id/run")
    tokens = [mute.liveliness().declare_token(key) for key in keys]
    until(
        (Level.OK, f"{endpoint}: connected"),
        (Level.OK, "under the prefix 'beacon': mute"),
        (Level.NOTE, "connected, but not saying what they are when asked: mute"),
        listen=(endpoint,),
    )
    assert len(tokens) == 2


def test_with_access_control_not_to_see_anybody_is_no_proof(plant: Plant) -> None:
    nothing: dict[str, Any] = {key: [] for key in ("rules", "subjects", "policies")}
    control = {"access_control": {"enabled": True, "default_permission": "deny", **nothing}}
    endpoint = plant.router(config=control)
    plant.announce(endpoint, "arm", heard=False)
    _, finding = look(NO_TIME_S, listen=(endpoint,), config=control)
    assert finding.level is Level.NOTE
    assert finding.what.endswith(", as far as access control lets us see")


# Doors


@pytest.fixture
def users(tmp_path: Path) -> str:
    path = tmp_path / "users"
    path.write_text("arm:secret\nlidar:secret\n")
    return str(path)


def test_a_router_that_knows_users_is_looked_at_as_the_first_of_them(
    plant: Plant, users: str
) -> None:
    endpoint = plant.router(users_file=users)
    assert look(NO_TIME_S, listen=(endpoint,), users_file=users)[0].level is Level.OK
    as_client = {"mode": "client", "connect": (endpoint,), "user": "lidar", "password": "secret"}
    assert look(NO_TIME_S, **as_client)[0].level is Level.OK


@pytest.mark.parametrize(
    ("given", "advice"),
    [
        ({"user": "arm", "password": "guess"}, "check user and password at both ends"),
        ({}, "or does it want tls/, or a user?"),
    ],
)
def test_a_wrong_password_or_none_is_told_as_far_as_it_can_be(
    plant: Plant, users: str, given: dict[str, Any], advice: str
) -> None:
    endpoint = plant.router(users_file=users)
    (finding,) = look(mode="client", connect=(endpoint,), **given)
    assert told([finding]) == [(Level.PROBLEM, f"{endpoint}: it answers, but lets us not in")]
    assert advice in finding.advice


def test_the_right_papers_open(plant: Plant, papers: Papers) -> None:
    endpoint = plant.tls_router(papers.of("gateway"))
    plant.announce(endpoint, "arm", tls=papers.of("robot"))
    until(
        (Level.OK, f"{endpoint}: connected"),
        (Level.OK, "under the prefix 'beacon': arm"),
        listen=(endpoint,),
        tls=papers.of("gateway"),
    )


@pytest.mark.parametrize(
    ("mine", "why"),
    [
        ({"believes": "theirs"}, "its certificate is not believed here"),
        ({"signed": "theirs"}, "it does not take this configuration's certificate"),
    ],
)
def test_wrong_papers_are_told_at_which_end(
    plant: Plant,
    papers: Papers,
    mine: dict[str, str],
    why: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("beacon_zenoh.probe._REFUSAL_S", 10.0)
    endpoint = plant.tls_router(papers.of("gateway"))
    (finding,) = look(mode="client", connect=(endpoint,), tls=papers.of("robot", **mine))
    assert finding.level is Level.PROBLEM
    assert finding.what.startswith(f"{endpoint}: {why}")
    assert "certificate" in finding.advice


def test_a_tls_router_that_wants_nobodys_certificate_cannot_be_proven_by_itself(
    plant: Plant, papers: Papers
) -> None:
    alone = attrs.evolve(papers.of("gateway"), ca="")
    (finding,) = look(listen=(plant.tls_router(alone),), tls=alone)
    assert finding.level is Level.NOTE
    assert "without a ca" in finding.what


def test_tls_without_fault_before_a_door_that_stays_shut(
    plant: Plant, papers: Papers, monkeypatch: pytest.MonkeyPatch
) -> None:
    endpoint = plant.tls_router(papers.of("gateway"))
    monkeypatch.setattr(module, "why_no_tls", lambda *_: "")
    mine = papers.of("robot", signed="theirs")
    (finding,) = look(mode="client", connect=(endpoint,), tls=mine)
    assert finding.what == f"{endpoint}: it answers, but lets us not in"


def test_an_endpoint_without_a_host_and_a_port_is_left_to_zenoh(tmp_path: Path) -> None:
    endpoint = f"unixsock-stream/{tmp_path}/socket"
    (finding,) = examine(ZenohOptions(mode="client", connect=(endpoint,)), NO_TIME_S)
    assert finding.what == f"{endpoint}: it answers, but lets us not in"
