"""What source and announcer promise beside the contract, to nodes as rmw_zenoh makes them."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import pytest
import zenoh

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.parameters.fields import ENTITY_ID, PREFIX, write
from beacon_core.ports.graph import Graph
from beacon_core.ports.health import Condition
from beacon_core.ports.targeted import Targeted
from beacon_core.testing.harness import Listener
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.rmw import attachment
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.lookalikes import open_session
from beacon_zenoh.rmw.tokens import token_key
from beacon_zenoh.rmw_param import ADAPTER, RmwParamOptions, clients, messages
from beacon_zenoh.rmw_param import announcer as announcer_module
from beacon_zenoh.rmw_param import source as module
from beacon_zenoh.rmw_param.announcer import RmwParamAnnouncer
from beacon_zenoh.rmw_param.harness import RmwParamHarness
from beacon_zenoh.rmw_param.lookalikes import ParamRobot
from beacon_zenoh.rmw_param.messages import Event, ListRequest
from beacon_zenoh.rmw_param.services import GET, LIST, SERVICES, service_member
from beacon_zenoh.rmw_param.source import RmwParamSource

IN_TIME_S = 5.0

ENGINE = write(BeaconHint("engine", display_name="Engine"))


class Slow(RmwParamHarness):
    """Asks once in a minute: what is seen sooner was seen otherwise. Nobody is given up whom a busy
    machine lets answer late."""

    def options(self, network: int = 0) -> RmwParamOptions:
        return attrs.evolve(
            super().options(network), interval_s=60.0, timeout_s=30.0, budget_s=60.0
        )


@pytest.fixture
def harness() -> Iterator[RmwParamHarness]:
    made = RmwParamHarness()
    yield made
    made.close()


@pytest.fixture
def slow() -> Iterator[RmwParamHarness]:
    made = Slow()
    yield made
    made.close()


@pytest.fixture
def robots() -> Iterator[Callable[..., ParamRobot]]:
    made: list[ParamRobot] = []

    def make(harness: RmwParamHarness, *args: Any, **kwargs: Any) -> ParamRobot:
        made.append(ParamRobot(harness.endpoint, *args, **kwargs))
        return made[-1]

    yield make
    for robot in made:
        robot.close()


def within(
    harness: RmwParamHarness, predicate: Callable[[], object], what: str, seconds: float = IN_TIME_S
) -> None:
    found = harness.wait_until(lambda: bool(predicate()), seconds)
    assert found, f"not within {seconds} s: {what}"


def has(listener: Listener, entity_id: str, status: Status = Status.ACTIVE) -> Callable[[], bool]:
    return lambda: listener.has(entity_id, status)


def counters(listener: Listener) -> dict[str, int]:
    return dict(listener.source.health().counters)


def source_of(listener: Listener) -> RmwParamSource:
    assert isinstance(listener.source, RmwParamSource)
    return listener.source


# Asking


def test_a_node_of_rmw_zenoh_is_asked_and_only_two_of_its_services(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(harness).start()
    robot = robots(harness, ENGINE)
    within(harness, has(listener, "engine"), "engine is known")
    assert listener.says("engine", "Engine")
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.source == "/fleet/r1/talker"
    assert {call.incarnation for call in listener.tap.calls} == {f"{robot.session.zid()}-0"}
    assert set(robot.asked) == {"list_parameters", "get_parameters"}
    assert listener.source.health().condition is Condition.UP


def test_parameters_of_other_types_are_left_out_and_counted(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(harness).start()
    robots(harness, {**ENGINE, f"{PREFIX}.colour": "blue", f"{PREFIX}.process_id": "x"})
    within(harness, has(listener, "engine"), "engine is known")
    assert counters(listener)["skipped-parameters"] == 2


def test_a_node_that_is_gone_is_lost_at_once_and_why_is_told(
    slow: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(slow).start()
    robot = robots(slow, ENGINE)
    within(slow, has(listener, "engine"), "engine is known")
    robot.close()
    within(slow, has(listener, "engine", Status.STALE), "engine is stale", 1.0)
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.cause is Cause.LOST
    assert stored.detail == "its node left the ROS graph without a goodbye"


def test_a_node_that_hangs_is_named_and_nothing_is_told_of_it(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    class Hasty(RmwParamHarness):
        endpoint = harness.endpoint

        def options(self, network: int = 0) -> RmwParamOptions:
            return attrs.evolve(super().options(network), timeout_s=0.1)

    hasty = Hasty()
    try:
        listener = Listener(hasty).start()
        robot = robots(harness, ENGINE)
        within(harness, has(listener, "engine"), "engine is known")
        robot.answers.clear()
        within(
            harness,
            lambda: listener.source.health().detail == "/fleet/r1/talker does not answer",
            "it is named",
        )
        assert listener.source.health().condition is Condition.DEGRADED
        assert not any(call.kind == "lost" for call in listener.tap.calls)
        robot.answers.set()
        within(
            harness, lambda: listener.source.health().condition is Condition.UP, "it is back", 10.0
        )
    finally:
        hasty.close()


def test_only_targets_are_asked_if_they_are_given_and_who_is_missing_is_named(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    robots(harness, ENGINE)
    brake = robots(harness, write(BeaconHint("brake")), name="_brake")
    targets: Any = ["/fleet/r1/_brake", "/nobody"]
    source = RmwParamSource(attrs.evolve(harness.options(), targets=targets))
    listener = Listener(harness)
    listener.source.close()
    listener.source = source
    try:
        listener.start()
        within(harness, has(listener, "brake"), "brake is known")
        assert listener.status("engine") is None
        assert source.health().detail == "/nobody is not in the ROS graph"
        assert brake.asked
    finally:
        source.close()


def test_whom_to_ask_may_be_told_at_any_time(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(harness)
    assert isinstance(listener.source, Targeted)
    listener.source.set_targets(frozenset())
    listener.start()
    robots(harness, ENGINE)
    within(harness, lambda: counters(listener)["nodes"] == 1, "the node is seen")
    assert counters(listener)["targets"] == 0
    listener.source.set_targets(frozenset({"/fleet/r1/talker"}))
    within(harness, has(listener, "engine"), "engine is known")
    listener.source.set_targets(None)
    robots(harness, write(BeaconHint("brake")), name="brake")
    within(harness, has(listener, "brake"), "brake is known")


def test_several_domains_are_heard_at_once_and_told_apart(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    robots(harness, ENGINE)
    robots(harness, write(BeaconHint("brake")), domain=7)
    robots(harness, write(BeaconHint("light")), domain=8)
    domains: Any = [0, 7]
    source = RmwParamSource(attrs.evolve(harness.options(), ros_domain_ids=domains))
    listener = Listener(harness)
    listener.source.close()
    listener.source = source
    try:
        listener.start()
        within(harness, lambda: listener.store.size() == 2, "both are known")
        names = {hint.source for hint in listener.store.snapshot()}
        assert names == {"0/fleet/r1/talker", "7/fleet/r1/talker"}
    finally:
        source.close()


def test_a_node_without_services_is_no_complaint(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(harness).start()
    robots(harness, services=(LIST,))
    within(harness, lambda: counters(listener)["unreachable"] == 1, "it cannot be asked")
    assert listener.source.health().condition is Condition.UP


# Who answers what


@pytest.mark.parametrize("service", ["list_parameters", "get_parameters"])
@pytest.mark.parametrize("said", [b"\0", b"\0\1\0\0\xff\xff\xff\xff", bytes(2_000_000)])
def test_an_answer_that_is_none_is_counted_and_the_node_has_failed(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot], service: str, said: bytes
) -> None:
    robot = robots(harness, ENGINE)
    robot.said[service] = said
    listener = Listener(harness).start()
    within(harness, lambda: counters(listener)["bad-answers"], "it is counted")
    within(harness, lambda: counters(listener)["silent"], "it counts as silent")
    assert not listener.store.size()


def test_answers_of_others_than_the_node_are_dropped(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    robot = robots(harness, ENGINE)
    stranger = open_session(harness.endpoint)
    lie = messages.encode_list_response([ENTITY_ID])
    for number, service in enumerate((LIST, GET)):
        member = service_member(robot.node, number, service)

        def deny(query: zenoh.Query) -> None:
            with query:
                query.reply(query.key_expr, lie)

        stranger.declare_queryable(data_key(member.data_key), deny, complete=True)
    listener = Listener(harness).start()
    within(harness, has(listener, "engine"), "engine is known")
    within(harness, lambda: counters(listener)["foreign-answers"] > 2, "the lies are counted")
    assert listener.has("engine")
    assert listener.says("engine", "Engine")
    stranger.close()


def test_a_flood_of_answers_to_one_question_is_cut_off(harness: RmwParamHarness) -> None:
    session = open_session(harness.endpoint)
    woken: list[int] = []
    asked = clients.ZenohClients({}, 1.0, lambda: woken.append(1))
    asked.session = session

    def babble(query: zenoh.Query) -> None:
        with query:
            for _ in range(100):
                query.reply(query.key_expr, b"?")

    session.declare_queryable("0/babble", babble, complete=True)
    heard: list[object] = []
    drop = asked.ask("0/babble", "another", b"", messages.decode_names, heard.append)
    within(harness, lambda: asked.foreign_answers > 80, "they are counted")
    within(harness, lambda: len(woken) == clients.MAX_ANSWERS + 1, "there are no more")
    assert asked.waiting == 1
    asked.deliver()
    assert heard == [None]
    assert asked.foreign_answers == 100
    assert asked.waiting == 0
    drop()
    session.close()


def test_an_answer_that_is_not_wanted_any_more_is_not_even_read(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    robot = robots(harness, ENGINE)
    woken: list[int] = []
    asked = clients.ZenohClients({}, 1.0, lambda: woken.append(1))
    asked.session = open_session(harness.endpoint)
    key = data_key(service_member(robot.node, 9, LIST).data_key)
    asked.ask(key, "", b"", messages.decode_list_response, lambda _: pytest.fail("not wanted"))()
    within(harness, lambda: woken, "the question has ended")
    asked.deliver()
    asked.session.close()


def test_without_a_session_or_services_nothing_can_be_asked() -> None:
    asked = clients.ZenohClients({}, 1.0, lambda: None)
    client = asked("/engine")
    assert not client.ready()
    with pytest.raises(zenoh.ZError, match="services"):
        client.list_names(lambda _: None)
    with pytest.raises(zenoh.ZError, match="session"):
        asked.ask("0/a", "", b"", messages.decode_names, lambda _: None)
    client.close()


# Events


def test_a_change_that_an_event_tells_of_is_seen_at_once(
    slow: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(slow).start()
    robot = robots(slow, ENGINE)
    within(slow, has(listener, "engine"), "engine is known")
    changed = {f"{PREFIX}.display_name": "Motor"}
    robot.parameters = {**ENGINE, **changed}
    robot.tell(Event("/fleet/r1/talker", changed=changed))
    within(slow, lambda: listener.says("engine", "Motor"), "the change is seen")
    assert counters(listener)["nudges"] == 1


@pytest.mark.parametrize(
    "event",
    [
        Event("/fleet/r1/talker", changed={ENTITY_ID: ""}),
        Event("/fleet/r1/talker", deleted=[ENTITY_ID]),
        Event("/fleet/r1/talker", changed={ENTITY_ID: 7}),
    ],
)
def test_a_node_that_takes_its_hint_back_and_leaves_said_goodbye(
    slow: RmwParamHarness, robots: Callable[..., ParamRobot], event: Event
) -> None:
    listener = Listener(slow).start()
    robot = robots(slow, ENGINE)
    within(slow, has(listener, "engine"), "engine is known")
    robot.answers.clear()
    robot.parameters = {}  # should it answer before it is gone, it must not bring the hint back
    robot.tell(event)
    within(slow, lambda: counters(listener)["events"], "the event is heard")
    robot.close()
    within(slow, has(listener, "engine", Status.LEFT), "engine has left")


def test_events_about_something_else_are_no_events_and_broken_ones_are_counted(
    slow: RmwParamHarness, robots: Callable[..., ParamRobot], monkeypatch: pytest.MonkeyPatch
) -> None:
    listener = Listener(slow).start()
    robot = robots(slow, ENGINE)
    within(slow, has(listener, "engine"), "engine is known")
    robot.tell(Event("/fleet/r1/talker", changed={"use_sim_time": 1}))
    robot.put_event(b"\0\1\0\0 ros2_medkit.discovery")
    within(slow, lambda: counters(listener)["bad-events"] == 1, "it is counted")
    robot.put_event(bytes(2_000_000))
    within(slow, lambda: counters(listener)["events-dropped"] == 1, "it is dropped")
    monkeypatch.setattr(module, "_MAX_EVENTS", 0)
    robot.tell(Event("/fleet/r1/talker", changed={ENTITY_ID: ""}))
    within(slow, lambda: counters(listener)["events-dropped"] == 2, "it is dropped")
    assert counters(listener)["events"] == 0
    assert listener.has("engine")


# Lives of a source


def test_a_source_says_where_it_stands(harness: RmwParamHarness) -> None:
    listener = Listener(harness)
    assert listener.source.health().condition is Condition.STARTING
    listener.start()
    within(harness, lambda: listener.source.health().condition is Condition.UP, "it is connected")
    with pytest.raises(UsageError):
        listener.start()
    listener.source.close()
    assert listener.source.health().condition is Condition.CLOSED


def test_the_nodes_it_knows_are_told_by_name(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot]
) -> None:
    listener = Listener(harness).start()
    source = listener.source
    assert isinstance(source, Graph)
    name = robots(harness).node.node_name
    within(harness, lambda: name in source.nodes(), "the node is known")
    source.close()
    assert source.nodes() == frozenset()


def test_a_budget_below_the_time_out_is_warned_of(
    harness: RmwParamHarness, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        RmwParamSource(attrs.evolve(harness.options(), budget_s=1.0, timeout_s=1.0)).close()
    assert "budget_s: 1 is not above timeout_s (1)" in caplog.text


def test_a_ghost_that_never_answers_is_seen_through_on_another_session(
    harness: RmwParamHarness, robots: Callable[..., ParamRobot], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_zenoh.rmw.watch.DOUBTED_AFTER_NS", 0)
    monkeypatch.setattr(module, "_DOUBT_EVERY_NS", 0)
    robots(harness, ENGINE)
    listener = Listener(harness).start()
    within(harness, has(listener, "engine"), "engine is known")
    source = source_of(listener)
    ghost = attrs.evolve(robots(harness, name="other").node, zid="dead", node="ghost")
    for member in (ghost, *(service_member(ghost, 5, one) for one in (LIST, GET))):
        source.graph.appeared(token_key(member))
    source.set_targets(None)
    within(harness, lambda: counters(listener)["renewals"] > 0, "another session is taken", 20.0)
    within(harness, lambda: counters(listener)["silent"] == 0, "the ghost is gone")
    names = [view.node.node for view in source.graph.nodes()]
    assert names == ["other", "talker"]
    assert listener.has("engine")
    assert not any(call.kind == "lost" for call in listener.tap.calls)


# Announcing


class Asker:
    """Asks as rmw_zenoh's clients do, and takes no answer without attachment."""

    def __init__(self, endpoint: str) -> None:
        self.session = open_session(endpoint)
        self.gid = b"g" * attachment.GID_BYTES

    def ask(self, key: str, request: bytes, beside: bytes | None = None) -> list[bytes]:
        given = attachment.encode(self.gid, 7, time.time_ns()) if beside is None else beside
        replies = self.session.get(
            key,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=2.0,
            payload=request,
            attachment=given,
        )
        found = [reply.ok for reply in replies if reply.ok is not None]
        for one in found:
            assert one.attachment is not None
            envelope = attachment.decode(one.attachment.to_bytes())
            assert envelope is not None
            assert envelope[:2] == (self.gid, 7)
        return [one.payload.to_bytes() for one in found]


@pytest.fixture
def asker(harness: RmwParamHarness) -> Iterator[Asker]:
    made = Asker(harness.endpoint)
    yield made
    made.session.close()


def keys_of(harness: RmwParamHarness, announcer: Any, node: int = 1) -> dict[str, str]:
    name = f"/{announcer._space}/e{node}"
    listener = Listener(harness).start()
    graph = source_of(listener).graph

    def view() -> Any:
        return next((one for one in graph.nodes() if one.node.node_name == name), None)

    within(harness, lambda: view() and len(view().members) == 7, "all its tokens are seen")
    return {
        one.name.rpartition("/")[2]: data_key(one.data_key)
        for one in view().members
        if one.type_name != "rcl_interfaces/msg/ParameterEvent"
    }


def test_an_announced_entity_is_a_node_with_all_six_services(
    harness: RmwParamHarness, asker: Asker
) -> None:
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine", display_name="Engine"))
    keys = keys_of(harness, announcer)
    assert set(keys) == {service.name for service in SERVICES}
    (listed,) = asker.ask(
        keys["list_parameters"], messages.encode_list_request(ListRequest((PREFIX,)))
    )
    assert messages.decode_list_response(listed) == list(ENGINE)
    (values,) = asker.ask(keys["get_parameters"], messages.encode_names(list(ENGINE)))
    assert messages.decode_values(values) == list(ENGINE.values())
    for name in ("get_parameter_types", "describe_parameters"):
        assert asker.ask(keys[name], messages.encode_names([ENTITY_ID]))
    for name in ("set_parameters", "set_parameters_atomically"):
        (refusal,) = asker.ask(keys[name], b"\0\1\0\0\0\0\0\0")
        assert (b"read-only" in refusal) == (name == "set_parameters_atomically")


def test_what_is_no_question_of_rmw_zenoh_gets_no_answer(
    harness: RmwParamHarness, asker: Asker
) -> None:
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine"))
    key = keys_of(harness, announcer)["list_parameters"]
    request = messages.encode_list_request(ListRequest())
    assert asker.ask(key, request)
    assert not asker.ask(key, request, b"no attachment of ours")
    assert not asker.ask(key, b"no request")
    assert not asker.ask(key, bytes(2_000_000))
    assert not asker.ask(key.replace("/e1/", "/e2/"), request)
    assert not asker.ask(key.replace("RIHS01_3", "RIHS01_4"), request)
    assert not asker.ask(key.replace("/list_parameters/", "/get_parameters/"), request)
    assert not asker.ask(key.replace("srv::dds_::ListP", "srv::dds_::P"), request)
    assert not asker.ask(key.rpartition("/")[0] + "/*", request)
    assert asker.ask(key, request)


def test_more_questions_than_can_be_held_are_dropped_and_counted(
    harness: RmwParamHarness, asker: Asker, monkeypatch: pytest.MonkeyPatch
) -> None:
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine"))
    key = keys_of(harness, announcer)["list_parameters"]
    monkeypatch.setattr(announcer_module, "_MAX_QUESTIONS", 0)
    assert not asker.ask(key, messages.encode_list_request(ListRequest()))
    assert announcer.health().counters["questions-dropped"] > 0


def test_its_events_tell_at_once_what_changes_and_who_leaves(slow: RmwParamHarness) -> None:
    listener = Listener(slow).start()
    announcer = slow.announcer()
    announcer.announce(BeaconHint("engine", display_name="cold"))
    within(slow, has(listener, "engine"), "engine is known")
    announcer.announce(BeaconHint("engine", display_name="warm"))
    within(slow, lambda: listener.says("engine", "warm"), "the change is seen")
    announcer.withdraw("engine")
    within(slow, has(listener, "engine", Status.LEFT), "engine has left")


def test_the_node_of_a_withdrawn_entity_is_taken_down_after_a_while(
    harness: RmwParamHarness,
) -> None:
    listener = Listener(harness).start()
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine"))
    announcer.announce(BeaconHint("brake"))
    within(harness, lambda: counters(listener)["nodes"] == 2, "both are seen")
    announcer.withdraw("engine")
    announcer.withdraw("engine")
    within(harness, lambda: counters(listener)["nodes"] == 1, "one is taken down")
    assert announcer.health().counters["entities"] == 1
    announcer.announce(BeaconHint("engine"))
    within(harness, lambda: counters(listener)["nodes"] == 2, "it is back")
    within(harness, has(listener, "engine"), "engine is known")


def test_an_announcer_says_whether_anybody_asks(harness: RmwParamHarness) -> None:
    announcer = harness.announcer()
    within(harness, lambda: announcer.health().condition is Condition.UP, "it is connected")
    announcer.announce(BeaconHint("engine"))
    health = announcer.health()
    assert health.condition is Condition.STARTING
    assert health.detail.startswith("nobody asks for the parameters of /beacon_param_")
    Listener(harness).start()
    within(harness, lambda: announcer.health().condition is Condition.UP, "somebody asks")
    assert isinstance(announcer, RmwParamAnnouncer)
    announcer._missed_ns = 0
    assert announcer.health().condition is Condition.DOWN
    announcer.close()
    assert announcer.health().condition is Condition.CLOSED


def test_closing_waits_for_who_asked_but_not_for_ever(harness: RmwParamHarness) -> None:
    listener = Listener(harness).start()
    announcer = harness.announcer()
    announcer.announce(BeaconHint("engine"))
    within(harness, has(listener, "engine"), "engine is known")
    listener.source.close()
    began = time.monotonic()
    announcer.close()
    assert time.monotonic() - began < 1.0


def test_without_a_router_it_is_patient(harness: RmwParamHarness) -> None:
    announcer = ADAPTER.announcer(RmwParamOptions(connect=(free_endpoint(),)), None)
    announcer.announce(BeaconHint("engine"))
    announcer.withdraw("engine")
    announcer.withdraw("nobody")
    assert announcer.health().condition is Condition.STARTING
    announcer.close()
    with pytest.raises(UsageError, match="closed"):
        announcer.announce(BeaconHint("engine"))
    announcer.withdraw("engine")
    with pytest.raises(ConfigError, match="period_s"):
        ADAPTER.announcer(harness.options(), 0.0)


def test_after_a_fork_it_must_be_made_anew(harness: RmwParamHarness) -> None:
    announcer, source = harness.announcer(), harness.source()
    for made in (announcer, source):
        made._keeper._pid = os.getpid() + 1  # type: ignore[union-attr]
    with pytest.raises(UsageError, match="fork"):
        announcer.announce(BeaconHint("engine"))
    announcer.withdraw("engine")
    announcer.close()
    source.set_targets(None)  # type: ignore[attr-defined]
    source.close()
    for made in (announcer, source):
        made._keeper._pid = os.getpid()  # type: ignore[union-attr]
