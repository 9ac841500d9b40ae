from __future__ import annotations

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import Qos, TopicType


def test_a_topic_that_says_nothing_of_its_quality_of_service_has_the_usual_one() -> None:
    assert SeenTopic(TopicType("a", "b")).qos == Qos()
