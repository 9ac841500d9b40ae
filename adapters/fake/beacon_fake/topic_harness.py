"""The in-memory network of topics, as the suite for topic sides wants it."""

from __future__ import annotations

from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import PeerPublisher, TopicCapabilities
from beacon_fake.topic_side import FakePublisher, FakeSubscription, FakeTopics, FakeTopicSide

__all__ = ["FakeTopicHarness"]


class FakeTopicHarness:
    """Implements :class:`beacon_core.testing.relay.topic_harness.TopicHarness`."""

    capabilities = TopicCapabilities()
    patience_s = 10.0
    quiet_s = 0.03
    types = (TopicType("fake_msgs/msg/Text", "F1"), TopicType("fake_msgs/msg/Image", "F2"))
    bad_types = (TopicType("unknown_msgs/msg/Secret", "F3"),)

    def __init__(self) -> None:
        self.network = FakeTopics(refused=self.bad_types)
        self._sides: list[FakeTopicSide] = []

    def side(self) -> FakeTopicSide:
        made = self.network.side()
        self._sides.append(made)
        return made

    def publisher(
        self,
        topic: str,
        of: TopicType,
        qos: Qos,
        *,
        mortal: bool = False,  # noqa: ARG002 - here all may be killed
    ) -> FakePublisher:
        return self.network.publisher(topic, of, qos)

    def subscription(self, topic: str, of: TopicType, qos: Qos) -> FakeSubscription:
        return self.network.subscription(topic, of, qos)

    def crash(self, publisher: PeerPublisher) -> None:
        publisher.close()

    def message(self, body: bytes) -> bytes:
        return b"fake" + body

    def close(self) -> None:
        for side in self._sides:
            side.close()
