"""What a relay tells over HTTP and to Prometheus."""

from __future__ import annotations

import threading

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from beacon_gateway.relay.relay import Relay
from beacon_gateway.relay.routes import RELAY_PATH


def test_its_report_is_served(served: tuple[Relay, str]) -> None:
    told = httpx.get(served[1] + RELAY_PATH).json()
    robot, site = told["ends"]
    assert (robot["name"], robot["link"], robot["conduit"]) == ("robot", "up", robot["conduit"])
    assert robot["forward"]["messages"] == 3
    assert site["republish"]["ended"] == {"delivered": 3}
    assert "republish" not in robot


def test_a_topic_is_explained(served: tuple[Relay, str]) -> None:
    told = httpx.get(f"{served[1]}{RELAY_PATH}/explain", params={"topic": "/secret"}).json()
    (robot,) = told["ends"]
    assert (robot["end"], robot["allowed"]) == ("robot", False)
    assert robot["routes"][0]["reason"] == "denied by rule 0: /secret"


@pytest.mark.parametrize("topic", ["", "chatter"])
def test_what_is_no_topic_is_refused_with_a_way_out(served: tuple[Relay, str], topic: str) -> None:
    answer = httpx.get(f"{served[1]}{RELAY_PATH}/explain?topic={topic}")
    assert answer.status_code == 400
    assert "give the full name of a topic" in answer.json()["message"]


def test_each_message_is_in_exactly_one_number(served: tuple[Relay, str]) -> None:
    text = httpx.get(f"{served[1]}/metrics").text
    samples: dict[tuple[str, ...], float] = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            labels = (one for one in sample.labels.values())
            samples[(sample.name, *labels)] = sample.value
    assert samples["beacon_relay_link_up", "robot"] == 1
    assert samples["beacon_relay_routes", "robot", "open"] == 1
    assert samples["beacon_relay_routes", "robot", "refused"] == 1
    assert samples["beacon_relay_topics", "site", "live"] == 1
    for name, side in (("robot", "forward"), ("site", "republish")):
        ended = sum(
            value
            for (metric, *labels), value in samples.items()
            if metric == "beacon_relay_ended_total" and {name, side} <= {*labels}
        )
        assert samples["beacon_relay_messages_total", name, side] == 3
        assert ended + samples["beacon_relay_held", name, side] == 3


def test_an_end_that_is_stuck_is_told_of_and_holds_up_no_other(served: tuple[Relay, str]) -> None:
    relay, url = served
    held, go_on = threading.Event(), threading.Event()

    def hold() -> None:
        held.set()
        go_on.wait(30)

    holder = threading.Thread(target=relay.ends["robot"]._turns.take, args=(hold,))
    holder.start()
    assert held.wait(10)
    # Each answer waits a second for the one that is stuck.
    robot, site = httpx.get(url + RELAY_PATH, timeout=60).json()["ends"]
    assert (robot["link"], site["link"]) == ("stuck", "up")
    assert "forward" not in robot
    text = httpx.get(f"{url}/metrics", timeout=60).text
    assert 'beacon_relay_link_up{end="robot"} 0.0' in text
    assert 'beacon_relay_link_up{end="site"} 1.0' in text
    go_on.set()
    holder.join(10)
    assert httpx.get(url + RELAY_PATH).json()["ends"][0]["link"] == "up"
