"""Messages go out in order, at once or when those who are to hear them are there."""

from __future__ import annotations

from typing import Any, cast

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: nothing can be published")

from beacon_core.relay.effects import CreatePublisher, Publish
from beacon_core.relay.marks import Mark
from beacon_core.relay.values import Qos, TopicType
from beacon_ros_topic.relay import offer as offer_module
from beacon_ros_topic.relay.endings import Endings
from beacon_ros_topic.relay.offer import Offer
from beacon_ros_topic.relay.voice import Voice

OURS, OTHERS = (7, 1), (8, 1)


class Line:
    """All that went out, of whichever voice, in order."""

    def __init__(self) -> None:
        self.sent: list[tuple[Mark, bytes]] = []
        self.counts: dict[Mark, int] = {}
        self.acknowledged = True
        self.closed: list[Mark] = []
        self.made: list[Mark] = []

    def voice(self, _: Offer, mark: Mark) -> Voice:
        self.made.append(mark)
        return cast("Voice", Spoken(self, mark))


class Spoken:
    """Stands for a ROS publisher, whose matching a test could not hold back."""

    def __init__(self, line: Line, mark: Mark) -> None:
        self._line, self._mark = line, mark
        self.gid = b"%d" % mark[0]

    def send(self, payload: bytes) -> None:
        if payload == b"refused":
            raise RuntimeError("ROS says no")
        self._line.sent.append((self._mark, payload))

    def count(self) -> int:
        return self._line.counts.get(self._mark, 0)

    def acknowledged(self) -> bool:
        return self._line.acknowledged

    def close(self) -> None:
        self._line.closed.append(self._mark)


def new_offer(topic: str = "/topic") -> Offer:
    return Offer(CreatePublisher(1, topic, TopicType("a/msg/B", "RIHS01_1"), Qos(), OURS[0]))


def publish(offer: Offer, payload: bytes, mark: Mark = OURS) -> bool:
    return offer.publish(Publish(1, payload, 0, *mark))


@pytest.fixture
def line() -> Line:
    return Line()


@pytest.fixture
def offer(line: Line) -> Offer:
    """One that is made, and has one subscription."""
    made = new_offer()
    made.open(line.voice(made, OURS))
    line.counts[OURS] = 1
    return made


def test_what_is_published_before_it_is_made_goes_out_when_it_is(line: Line) -> None:
    offer = new_offer()
    assert not publish(offer, b"1")
    assert offer.flush(line.voice)
    assert (offer.made, offer.count()) == (False, 0)
    offer.open(line.voice(offer, OURS))
    assert not publish(offer, b"2")
    assert not offer.flush(line.voice)
    assert line.sent == [(OURS, b"1"), (OURS, b"2")]


def test_its_own_mark_goes_out_at_once(line: Line, offer: Offer) -> None:
    assert publish(offer, b"1")
    assert line.sent == [(OURS, b"1")]


def test_another_mark_waits_for_its_publisher_to_match_and_all_that_follow_wait_too(
    line: Line, offer: Offer
) -> None:
    assert not publish(offer, b"1", OTHERS)
    assert not publish(offer, b"2", OURS)
    assert offer.flush(line.voice)
    assert line.sent == []
    line.counts[OTHERS] = 1
    assert not offer.flush(line.voice)
    assert line.sent == [(OTHERS, b"1"), (OURS, b"2")]
    assert publish(offer, b"3", OTHERS)
    assert line.made == [OURS, OTHERS]


def test_it_waits_half_a_second_at_most(
    line: Line, offer: Offer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(cast("Any", offer_module).time, "monotonic", lambda: now[0])
    publish(offer, b"1", OTHERS)
    assert offer.flush(line.voice)
    now[0] += 0.49
    assert offer.flush(line.voice)
    now[0] += 0.02
    assert not offer.flush(line.voice)
    assert line.sent == [(OTHERS, b"1")]


def test_more_than_can_be_held_does_not_wait(
    line: Line, offer: Offer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(offer_module, "_MOST_HELD_BYTES", 10)
    publish(offer, b"12345", OTHERS)
    assert offer.flush(line.voice)
    publish(offer, b"67890!", OTHERS)
    assert not offer.flush(line.voice)
    assert [payload for _, payload in line.sent] == [b"12345", b"67890!"]


def test_at_the_end_nothing_waits(line: Line, offer: Offer) -> None:
    publish(offer, b"1", OTHERS)
    assert not offer.flush(line.voice, at_once=True)
    assert line.sent == [(OTHERS, b"1")]


def test_what_ros_refuses_is_raised(line: Line, offer: Offer) -> None:
    with pytest.raises(RuntimeError, match="ROS says no"):
        publish(offer, b"refused")


def test_all_of_its_publishers_end_each_once(line: Line, offer: Offer) -> None:
    publish(offer, b"1", OTHERS)
    offer.flush(line.voice, at_once=True)
    assert offer.gids() == [b"7", b"8"]
    offer.close()
    offer.close()
    assert line.closed == [OURS, OTHERS]
    assert not offer.made
    assert not publish(offer, b"late")


# Endings


def test_what_ends_is_waited_for_until_all_is_acknowledged(line: Line, offer: Offer) -> None:
    endings, ended = Endings(), list[Offer]()
    line.acknowledged = False
    endings.begin(offer)
    wait_s = endings.step(line.voice, ended.append)
    assert wait_s is not None
    assert 0 < wait_s < 0.1
    assert endings.offers() == [offer]
    line.acknowledged = True
    assert endings.step(line.voice, ended.append) is None
    assert ended == [offer]


def test_what_follows_on_the_same_topic_waits_and_keeps_its_order(line: Line, offer: Offer) -> None:
    endings, ended, done = Endings(), list[Offer](), list[str]()
    next_one = new_offer()
    endings.begin(offer)
    endings.after("/topic", lambda: done.append("made"))
    endings.after("/topic", lambda: endings.begin(next_one))
    endings.after("/topic", lambda: done.append("made again"))
    endings.after("/other", lambda: done.append("other"))
    assert done == ["other"]
    assert endings.step(line.voice, ended.append) is not None
    assert done == ["other", "made"]
    assert endings.step(line.voice, ended.append) is None
    assert done == ["other", "made", "made again"]
    assert ended == [offer, next_one]


def test_nobody_is_waited_for_for_long(
    line: Line, offer: Offer, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    monkeypatch.setattr(cast("Any", offer_module).time, "monotonic", lambda: now[0])
    endings, ended = Endings(), list[Offer]()
    line.acknowledged = False
    endings.begin(offer)
    now[0] += 0.41
    assert endings.step(line.voice, ended.append) is None
    assert ended == [offer]


def test_what_cannot_be_said_any_more_is_not_waited_for(line: Line, offer: Offer) -> None:
    endings, ended = Endings(), list[Offer]()
    publish(offer, b"refused", OTHERS)
    line.counts[OTHERS] = 1
    endings.begin(offer)
    assert endings.step(line.voice, ended.append) is None
    assert ended == [offer]
