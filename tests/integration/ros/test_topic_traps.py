"""What the middleware does with what no program written for ROS would send."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: no topic to send anything on")

from beacon_core.hint import BeaconHint
from beacon_core.testing.harness import Listener
from beacon_ros_topic.harness import RosTopicHarness


@pytest.fixture
def harness() -> Iterator[RosTopicHarness]:
    made = RosTopicHarness()
    yield made
    made.close()


def test_who_sends_a_message_of_no_bytes_silences_nobody_but_itself(
    harness: RosTopicHarness,
) -> None:
    listener = Listener(harness).start()
    harness.send_raw("careless", harness.encode(BeaconHint("careless")), sender="careless")
    assert harness.wait_until(lambda: listener.status("careless") is not None, harness.patience_s)
    for payload in (b"", harness.encode(BeaconHint("silenced"))):
        harness.send_raw("careless", payload, sender="careless")
    harness.send_raw("neighbour", harness.encode(BeaconHint("neighbour")), sender="neighbour")
    assert harness.wait_until(lambda: listener.status("neighbour") is not None, harness.patience_s)
    assert not listener.tap.failures
    assert listener.status("silenced") is None, "Fast DDS has learnt it; ros_topic.md says not"
