"""Whole relays: what is published on one network, is published on the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.relay.relay import Relay
from beacon_gateway.relay.report import explained, report
from beacon_gateway.relay.trace import replay
from tests.unit.beacon_gateway.relay.plant import REFUSED, TEXT, Plant, end, wait_for


def test_a_topic_is_carried_under_its_new_name_with_its_type(
    plant: Plant, one_way: dict[str, Any]
) -> None:
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")
    relay = plant.relay(one_way)
    wait_for(lambda: bool(relay.ends["site"].state().lanes), "the route")
    for number in range(100):
        talker.publish(b"%d" % number)
    wait_for(lambda: len(heard.received()) == 100, "the last message")
    assert heard.received() == [b"%d" % number for number in range(100)]


def test_what_is_denied_stays(plant: Plant, one_way: dict[str, Any]) -> None:
    heard = plant.subscription("site", "/robot/secret")
    secret, chatter = plant.publisher("robot", "/secret"), plant.publisher("robot", "/chatter")
    relay = plant.relay(one_way)
    wait_for(lambda: len(relay.ends["site"].state().lanes) == 1, "the other route")
    secret.publish(b"x")
    chatter.publish(b"x")
    wait_for(lambda: report(relay)["ends"][0]["forward"]["messages"] == 1, "the other message")
    assert heard.received() == []


def test_who_joins_late_gets_the_state(plant: Plant, one_way: dict[str, Any]) -> None:
    latched = plant.publisher("robot", "/map", durable=True, depth=2)
    for number in range(5):
        latched.publish(b"%d" % number)
    relay = plant.relay(one_way)
    wait_for(lambda: bool(relay.ends["site"].state().lanes), "the route")
    late = plant.subscription("site", "/robot/map", durable=True, depth=2)
    wait_for(lambda: late.received() == [b"3", b"4"], "the last two")


def test_a_link_both_ways_is_two_of_them_and_nothing_goes_round(plant: Plant, link: str) -> None:
    ends = {
        "robot": end("robot", link, forward=[{"allow": "/up/**"}], republish=True),
        "site": end("site", link, forward=[{"allow": "/down/**"}], republish=True),
    }
    heard_up = plant.subscription("site", "/up/a")
    heard_down = plant.subscription("robot", "/down/b")
    up, down = plant.publisher("robot", "/up/a"), plant.publisher("site", "/down/b")
    relay = plant.relay(ends)
    wait_for(lambda: all(len(one.state().lanes) == 1 for one in relay.ends.values()), "both")
    up.publish(b"u")
    down.publish(b"d")
    wait_for(lambda: (heard_up.received(), heard_down.received()) == ([b"u"], [b"d"]), "both")


def test_names_that_let_a_message_go_round_are_refused_with_the_way(
    plant: Plant, link: str
) -> None:
    ends = {
        "robot": end("robot", link, forward=[{"allow": "/**"}], republish=True),
        "site": end("site", link, forward=[{"allow": "/**"}], republish=True),
    }
    with pytest.raises(ConfigError, match=r"circles(.|\n)*robot -> site: /\*\*"):
        Relay(plant.config(ends), find=plant.find)


def test_a_type_that_nobody_knows_is_refused_with_the_reason_and_harms_no_other(
    plant: Plant, one_way: dict[str, Any]
) -> None:
    plant.publisher("robot", "/odd", REFUSED)
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")
    relay = plant.relay(one_way)

    def topics() -> dict[str, Any]:
        (site,) = (one for one in report(relay)["ends"] if one["name"] == "site")
        return {one["name"]: one for one in site["republish"]["topics"]}

    wait_for(lambda: topics().get("/robot/odd", {}).get("state") == "refused", "the refusal")
    assert topics()["/robot/odd"]["reason"] == "nobody/msg/Knows is not known on this network"
    wait_for(lambda: "/robot/chatter" in topics(), "the other")
    talker.publish(b"x")
    wait_for(lambda: heard.received() == [b"x"])


def test_the_report_has_the_books_of_both_sides_and_they_agree(
    plant: Plant, one_way: dict[str, Any]
) -> None:
    plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")
    relay = plant.relay(one_way)
    wait_for(lambda: bool(relay.ends["site"].state().lanes), "the route")
    for _ in range(10):
        talker.publish(b"x")

    def told() -> tuple[dict[str, Any], dict[str, Any]]:
        robot, site = report(relay)["ends"]
        return robot["forward"], site["republish"]

    wait_for(lambda: told()[1]["ended"].get("delivered") == 10, "the last delivery")
    forward, republish = told()
    assert forward["messages"] == republish["messages"] == 10
    assert forward["messages"] == forward["held"] + sum(forward["ended"].values())
    (route,) = forward["routes"]
    assert (route["topic"], route["name"], route["mode"]) == (
        "/chatter",
        "/robot/chatter",
        "ordered",
    )
    (topic,) = republish["topics"]
    assert (topic["type"], topic["type_hash"]) == (TEXT.name, TEXT.digest)


def test_a_topic_is_explained_whether_it_is_there_or_not(
    plant: Plant, one_way: dict[str, Any]
) -> None:
    plant.publisher("robot", "/chatter")
    relay = plant.relay(one_way)
    wait_for(lambda: explained(relay, "/chatter")["ends"][0]["routes"] != [], "the route")
    (there,) = explained(relay, "/chatter")["ends"]
    assert there["reason"] == "allowed by rule 1: /**, renamed to /robot/chatter"
    (secret,) = explained(relay, "/secret")["ends"]
    assert (secret["allowed"], secret["reason"]) == (False, "denied by rule 0: /secret")
    assert explained(relay, "/nobody")["ends"][0]["routes"] == []


def test_what_is_compressed_on_the_way_arrives_as_it_was(plant: Plant, link: str) -> None:
    text = b"much the same as before, and again " * 100
    ends = {
        "robot": end("robot", link, forward={"rules": [{"allow": "/**"}], "compress": True}),
        "site": end("site", link, republish=True),
    }
    heard = plant.subscription("site", "/chatter")
    talker = plant.publisher("robot", "/chatter")
    relay = plant.relay(ends)
    wait_for(lambda: bool(relay.ends["site"].state().lanes), "the route")
    for _ in range(30):
        talker.publish(text)
    wait_for(lambda: heard.received() == [text] * 30)


def test_a_trace_is_replayed_alike(plant: Plant, one_way: dict[str, Any], tmp_path: Path) -> None:
    trace = tmp_path / "relay.trace"
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter", durable=True, depth=3)
    relay = plant.relay(one_way, trace=trace)
    wait_for(lambda: bool(relay.ends["site"].state().lanes), "the route")
    talker.publish(bytes(range(256)))
    wait_for(lambda: len(heard.received()) == 1)
    relay.close()
    steps = list(replay(trace))
    assert all(step.alike for step in steps)
    assert {"topic_seen", "message", "frame", "matched", "link_up"} <= {s.method for s in steps}
    assert {step.core for step in steps} == {"forwarder", "republisher"}


def test_two_relays_may_not_be_the_same_one(plant: Plant, one_way: dict[str, Any]) -> None:
    plant.relay(one_way)
    with pytest.raises(ConfigError, match="in use by another process"):
        plant.relay(one_way)


def test_a_relay_that_is_started_again_is_followed(plant: Plant, one_way: dict[str, Any]) -> None:
    heard = plant.subscription("site", "/robot/chatter")
    talker = plant.publisher("robot", "/chatter")
    link = one_way["robot"]["conduit"]["options"]["name"]
    site = {"site": end("site", link, republish=True)}
    robot = {"robot": one_way["robot"]}
    plant.relay(site)
    for number in range(2):
        first = plant.relay(robot)
        wait_for(lambda: bool(first.ends["robot"].state().routes), "the route")  # noqa: B023
        talker.publish(b"%d" % number)
        wait_for(lambda: len(heard.received()) == number + 1, f"message {number}")  # noqa: B023
        first.close()
        first.close()
    assert heard.received() == [b"0", b"1"]
