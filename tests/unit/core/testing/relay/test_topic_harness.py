"""What the topic sides' suite writes down, and how long it waits."""

from __future__ import annotations

import time

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import TopicType
from beacon_core.testing.relay.topic_harness import (
    Heard,
    TopicCapabilities,
    Watching,
)
from beacon_core.testing.waiting import wait_until

SEEN = SeenTopic(TopicType("a/msg/B", "RIHS01_1"))


def test_a_network_can_do_everything_unless_it_says_otherwise() -> None:
    capabilities = TopicCapabilities()
    assert capabilities.tells_relays
    assert capabilities.latches


def test_what_is_told_of_topics_is_kept_and_its_history_too() -> None:
    watching = Watching()
    watching.topic_seen("/a", SEEN)
    assert watching.topics == {"/a": SEEN}
    watching.topic_gone("/a")
    watching.topic_gone("/never")
    assert watching.topics == {}
    assert watching.tellings == [("/a", SEEN), ("/a", None), ("/never", None)]


def test_messages_are_kept_by_their_subscription() -> None:
    watching = Watching()
    watching.message(1, b"x", stamp_ns=5, first=7, hop=1)
    watching.message(2, b"y")
    assert watching.heard == [Heard(1, b"x", 5, 7, 1), Heard(2, b"y", 0, 0, 0)]
    assert watching.payloads(1) == [b"x"]


def test_the_last_match_of_each_publisher_is_known() -> None:
    watching = Watching()
    assert watching.last_match(1) is None
    watching.matched(1, 0, 2)
    watching.matched(1, 2, 2)
    assert watching.last_match(1) == (2, 2)


def test_failures_are_kept_with_their_reasons() -> None:
    watching = Watching()
    watching.publisher_failed(3, "no such type")
    assert watching.failures == [(3, "no such type")]


def test_each_call_is_counted_and_runs_the_hook() -> None:
    watching = Watching()
    ran: list[int] = []
    watching.topic_gone("/a")
    watching.hook = lambda: ran.append(watching.calls)
    watching.matched(1, 1, 1)
    assert (watching.calls, ran) == (2, [2])


def test_waiting_ends_when_it_is_so_or_the_time_is_over() -> None:
    looks = iter([False, False, True])
    assert wait_until(lambda: next(looks), 5.0)
    began = time.monotonic()
    assert not wait_until(lambda: False, 0.02)
    assert time.monotonic() - began >= 0.02
