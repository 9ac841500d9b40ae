"""A topic side between programs that know nothing of it: types it has, has not, and large ones."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no ROS to stand beside")

from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.relay.topic_harness import Watching
from beacon_ros.domains import DomainLease
from beacon_ros_topic.relay.harness import Peers
from beacon_ros_topic.relay.options import RosNetworkOptions
from beacon_ros_topic.relay.topic_side import RosTopicSide

WaitUntil = Callable[..., None]

IMAGE = TopicType(
    "sensor_msgs/msg/Image",
    "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
)


class Relay:
    """What comes by any topic on one domain goes out as ``/relayed`` on the other."""

    def __init__(self, here: int, there: int) -> None:
        self.inward, self.outward = Watching(), Watching()
        self._in = RosTopicSide(RosNetworkOptions(domain_id=here))
        self._out = RosTopicSide(RosNetworkOptions(domain_id=there))
        self._out.start(self.outward)
        self._in.start(self.inward)

    def carry(self, topic: str, wait_until: WaitUntil) -> None:
        """From when the topic is seen; and its listener is there."""
        wait_until(lambda: topic in self.inward.topics, f"{topic} is seen")
        seen = self.inward.topics[topic]
        self._out.create_publisher(CreatePublisher(1, "/relayed", seen.type, seen.qos, 1))
        wait_until(lambda: self.outward.last_match(1) == (1, 1), "the listener matches")
        self._in.subscribe(Subscribe(1, topic, seen.type, seen.qos))

    def hand_over(self) -> None:
        """What has come in goes out."""
        while self.inward.heard:
            one = self.inward.heard.pop(0)
            self._out.publish(Publish(1, one.payload, one.stamp_ns, 1, 1))

    def close(self) -> None:
        self._in.close()
        self._out.close()


@pytest.fixture
def there() -> Iterator[int]:
    with DomainLease() as lease:
        yield lease.domain_id


@pytest.fixture
def relay(domain: int, there: int) -> Iterator[Relay]:
    made = Relay(domain, there)
    yield made
    made.close()


@pytest.mark.parametrize(
    ("package", "name", "fields"),
    [
        ("std_msgs", "String", {"data": "grüße, 你好"}),
        (
            "ros2_medkit_msgs",
            "MedkitDiscoveryHint",
            {"entity_id": "engine", "display_name": "Engine", "depends_on": ["fuel", "air"]},
        ),
    ],
)
def test_a_typed_listener_hears_a_typed_publisher_whether_the_type_is_known_here_or_not(
    children: Any,
    typed: Mapping[str, str],
    there: int,
    relay: Relay,
    wait_until: WaitUntil,
    package: str,
    name: str,
    fields: dict[str, Any],
) -> None:
    plain = json.dumps(fields)
    children.node("relay_peer", "publish", package, name, "/said", plain, env=typed)
    elsewhere = {**typed, "ROS_DOMAIN_ID": str(there)}
    listener = children.node(
        "relay_peer", "listen", package, name, "/relayed", plain, env=elsewhere
    )
    relay.carry("/said", wait_until)
    assert relay.inward.topics["/said"].type.name == f"{package}/msg/{name}"

    def heard() -> bool:
        relay.hand_over()
        return len(listener.said()) >= 3

    wait_until(heard, "it is heard")
    assert all(one == fields for one in listener.said())
    assert not relay.outward.failures


def test_images_of_a_megabyte_arrive_all_and_whole(
    domain: int, there: int, relay: Relay, wait_until: WaitUntil
) -> None:
    here_peers, there_peers = Peers(domain), Peers(there)
    camera = here_peers.publisher("/camera", IMAGE, Qos(depth=10))
    got: list[bytes] = []
    node = there_peers.node
    from beacon_ros_topic.relay.rawtypes import type_for  # noqa: PLC0415 - beside its use

    there_peers.run(
        lambda: node.create_subscription(type_for(IMAGE), "/relayed", got.append, 10, raw=True)
    )
    relay.carry("/camera", wait_until)

    def begins() -> bool:
        camera.publish(image(0))
        relay.hand_over()
        return bool(got)

    wait_until(begins, "the first image comes")
    for number in range(1, 30):
        camera.publish(image(number))

        def came(number: int = number) -> bool:
            relay.hand_over()
            return image(number) in got[-20:]

        wait_until(came, f"image {number} comes")
    there_peers.close()
    here_peers.close()


def image(number: int) -> bytes:
    """1024 x 1024 grey pixels, by hand: sensor_msgs need not be installed anywhere."""
    text = struct.pack("<I4s", 4, b"cam\0")
    front = struct.pack("<4siI", b"\0\1\0\0", number, 0) + text + struct.pack("<II", 1024, 1024)
    encoding = struct.pack("<I6s", 6, b"mono8\0") + b"\0" + b"\0"
    pixels = bytes([number]) * 2**20
    return front + encoding + struct.pack("<II", 1024, len(pixels)) + pixels
