from __future__ import annotations

from beacon_core.relay.alarms import Alarms
from beacon_core.relay.effects import CreatePublisher, DestroyPublisher, Effect, Publish
from beacon_core.relay.frames import Advertisement, Content
from beacon_core.relay.lane import Lane, LaneState
from beacon_core.relay.publishers import Publishers
from beacon_core.relay.settings import Republishing
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode, Qos, TopicType

T1, T2 = TopicType("t", "1"), TopicType("t", "2")
CONTENT = Content(1, 1, 1, 0, 9, b"x", first=3, hop=2)


class Fixture:
    def __init__(self, settings: Republishing) -> None:
        self.alarms: Alarms[tuple[str, int, int]] = Alarms()
        self.effects: list[Effect] = []
        self.publishers = Publishers(settings, self.alarms, self.effects)
        self.lane = Lane(4, 1, "/n", 0)

    def provide(self, kind: TopicType) -> list[Effect]:
        self.effects.clear()
        advertised = Advertisement(1, 1, 1, 0, 0, 0, 0, "/n", kind, Qos(), Mode.ORDERED)
        self.publishers.provide(self.lane, Track(advertised, 0, 0), 10)
        return self.effects


def test_a_publisher_is_made_once_and_waits() -> None:
    one = Fixture(Republishing(match_ns=5))
    assert one.provide(T1) == [CreatePublisher(1, "/n", T1, Qos(), 1)]
    assert one.lane.state is LaneState.WAIT_MATCH
    assert one.publishers.lane_of(1) is one.lane
    assert one.alarms.next_ns() == 15
    assert one.provide(T1) == []


def test_the_fixed_delay_counts_instead_if_it_is_set_and_none_is_no_wait() -> None:
    one = Fixture(Republishing(match_ns=5, advertise_delay_ns=7))
    one.provide(T1)
    assert one.alarms.next_ns() == 17
    two = Fixture(Republishing(match_ns=5, advertise_delay_ns=0))
    two.provide(T1)
    assert two.lane.state is LaneState.LIVE
    assert two.alarms.next_ns() is None


def test_another_type_has_another_publisher() -> None:
    one = Fixture(Republishing())
    one.provide(T1)
    assert one.provide(T2) == [DestroyPublisher(1), CreatePublisher(2, "/n", T2, Qos(), 1)]
    assert one.publishers.lane_of(1) is None


def test_it_publishes_what_came_one_hop_further_and_only_if_it_can() -> None:
    one = Fixture(Republishing())
    assert not one.publishers.publish(one.lane, CONTENT)
    one.provide(T1).clear()
    assert one.publishers.publish(one.lane, CONTENT)
    assert one.effects == [Publish(1, b"x", 9, first=3, hop=3)]


def test_a_publisher_that_failed_is_gone_and_due_again_later() -> None:
    one = Fixture(Republishing(retry_ns=50))
    one.provide(T1).clear()
    one.publishers.fail(one.lane, "no such type", 20)
    assert (one.lane.state, one.lane.reason) == (LaneState.REFUSED, "no such type")
    assert one.publishers.lane_of(1) is None
    assert one.alarms.next_ns() == 70
    assert one.provide(T1) == []
    one.publishers.destroy(one.lane)
    assert one.effects == []
    assert one.alarms.next_ns() is None
