"""Networks of rmw_zenoh, and relays between them as processes of their own; no ROS is needed.

Each network is a router with programs that speak the dialect by Zenoh's own parts. Where rclpy is
installed, one of them is joined with a network of real ROS nodes over DDS.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import httpx
import pytest

pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed")
pytest.importorskip("xxhash", reason="xxhash is not installed")

from beacon_core.relay.values import Qos, TopicType
from beacon_core.testing.waiting import wait_until
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.rmw_relay.harness import BYTES, TEXT, Peers, RmwTopicSideHarness, message, text

if TYPE_CHECKING:
    from beacon_ros_topic.relay.harness import Peers as RosPeers

pytestmark = pytest.mark.system

RELIABLE = Qos(reliable=True, durable=False, depth=100)
LATCHED = Qos(reliable=True, durable=True, depth=1)
MEBIBYTE = bytes(range(256)) * 4096

END = """
ends:
  {name}:
    network: {network}
    conduit: {{adapter: zenoh, options: {{{conduit}}}}}
    {does}
http: {{port: 0}}
state_folder: {folder}
"""
RULES = "forward: [{deny: /rosout}, {deny: /parameter_events}, {allow: /**, to: /robot/**}]"


def eventually(true: Callable[[], object], what: str, within_s: float = 30.0) -> None:
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, f"not within {within_s} s: {what}"
        time.sleep(0.02)


@attrs.frozen
class End:
    """A running ``beacon relay``, asked over HTTP."""

    url: str
    process: subprocess.Popen[bytes]

    def told(self) -> dict[str, Any]:
        (end,) = httpx.get(f"{self.url}/api/v1/x-beacon-relay", timeout=10).json()["ends"]
        return dict(end)

    def published(self) -> dict[str, str]:
        """The topics that it publishes, and whether they are live."""
        return {one["name"]: one["state"] for one in self.told()["republish"]["topics"]}


def says_hello(say: Callable[[], None], heard: Callable[[], object]) -> None:
    """Until it is heard."""

    def answered() -> object:
        say()
        return heard()

    eventually(answered, "the first message")


@attrs.frozen
class Plant:
    """Starts ends, and ends them; what they said is shown with the test that failed."""

    folder: Path
    started: list[subprocess.Popen[bytes]] = attrs.field(factory=list)

    def end(self, name: str, network: str, conduit: str, does: str) -> End:
        config, out = self.folder / f"{name}.yaml", self.folder / f"{name}.out"
        config.write_text(
            END.format(
                name=name, network=network, conduit=conduit, does=does, folder=self.folder / name
            )
        )
        command = [sys.executable, "-m", "beacon_gateway", "relay", "-c", str(config), "--json"]
        with out.open("wb") as said, config.with_suffix(".err").open("wb") as errors:
            process = subprocess.Popen(command, stdout=said, stderr=errors)
        self.started.append(process)
        eventually(lambda: b"\n" in out.read_bytes() or process.poll() is not None, "it serves")
        assert process.poll() is None, config.with_suffix(".err").read_text()
        return End(json.loads(out.read_text().partition("\n")[0])["url"], process)

    def close(self) -> None:
        for process in self.started:
            process.send_signal(signal.SIGTERM)
        for process in self.started:
            process.wait(15)
        for path in sorted(self.folder.glob("*.err")):
            print(f"--- {path.name}:\n{path.read_text()[-8000:]}")  # noqa: T201 - pytest shows it


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[Plant]:
    made = Plant(tmp_path)
    yield made
    made.close()


@pytest.fixture
def robot() -> Iterator[RmwTopicSideHarness]:
    """A robot's network: a router, and programs."""
    made = RmwTopicSideHarness()
    yield made
    made.close()


@pytest.fixture
def site() -> Iterator[RmwTopicSideHarness]:
    """The site's, which is another one."""
    made = RmwTopicSideHarness()
    yield made
    made.close()


def beside(network: RmwTopicSideHarness) -> str:
    return f"{{adapter: zenoh_rmw, options: {{connect: [{network.endpoint}]}}}}"


def balanced(books: Mapping[str, Any]) -> bool:
    return bool(
        books["messages"] == books["held"] + books.get("missing", 0) + sum(books["ended"].values())
    )


def test_text_a_mebibyte_and_a_late_joiners_map_go_from_router_to_router_intact(
    plant: Plant, robot: RmwTopicSideHarness, site: RmwTopicSideHarness
) -> None:
    conduit = free_endpoint()
    at_site = plant.end("site", beside(site), f"listen: [{conduit}]", "republish: true")
    on_robot = plant.end("robot", beside(robot), f"connect: [{conduit}]", RULES)
    chatter = robot.peers.publisher("/chatter", TEXT, RELIABLE)
    camera = robot.peers.publisher("/camera/image", BYTES, RELIABLE)
    robot.peers.publisher("/map", TEXT, LATCHED).publish(text("the map"))
    heard = site.peers.subscription("/robot/chatter", TEXT, RELIABLE)
    seen = site.peers.subscription("/robot/camera/image", BYTES, RELIABLE)
    live = {"/robot/chatter": "live", "/robot/camera/image": "live", "/robot/map": "live"}
    eventually(lambda: at_site.published() == live, "all are published")
    texts = [text(f"text {number}") for number in range(50)]
    images = [message(MEBIBYTE[turn:] + MEBIBYTE[:turn]) for turn in range(10)]
    for said in texts:
        chatter.publish(said)
    for shown in images:
        camera.publish(shown)
    eventually(lambda: len(heard.received()) >= len(texts), "the texts")
    eventually(lambda: len(seen.received()) >= len(images), "the images")
    assert heard.received() == texts
    assert seen.received() == images
    assert heard.numbers == list(range(1, len(texts) + 1))
    # It was said once, before anybody was there.
    late = Peers(site.endpoint)
    latched = late.subscription("/robot/map", TEXT, LATCHED)
    eventually(lambda: latched.received() == [text("the map")], "the map")
    late.close()
    assert balanced(on_robot.told()["forward"])
    assert balanced(at_site.told()["republish"])
    assert set(at_site.told()["republish"]["ended"]) == {"delivered"}


def test_two_links_side_by_side_and_both_ways_make_no_echo(
    plant: Plant, robot: RmwTopicSideHarness, site: RmwTopicSideHarness
) -> None:
    """The same names everywhere: only the names of the relays' nodes tell what comes from whom."""
    both = "republish: true\n    forward: [{allow: /chatter}]"
    ends = []
    for number in range(2):
        conduit = free_endpoint()
        ends += [
            plant.end(f"site_{number}", beside(site), f"listen: [{conduit}]", both),
            plant.end(f"robot_{number}", beside(robot), f"connect: [{conduit}]", both),
        ]
    here = robot.peers.subscription("/chatter", TEXT, RELIABLE)
    there = site.peers.subscription("/chatter", TEXT, RELIABLE)
    chatter = robot.peers.publisher("/chatter", TEXT, RELIABLE)
    # The relays hear each other at the site, and each publishes at the robot what it heard there.
    eventually(lambda: all(end.published() == {"/chatter": "live"} for end in ends), "all do")
    said = [text(f"text {number}") for number in range(10)]
    for one in said:
        chatter.publish(one)

    def books() -> tuple[int, int]:
        told = [end.told()["forward"] for end in ends]
        return sum(one["messages"] for one in told), sum(
            one["ended"].get("echo", 0) for one in told
        )

    # Each relay on the robot meets what it took itself, once it has been there and back.
    eventually(lambda: books()[1] >= 2 * len(said), "what came back was known")
    before = books()
    assert not wait_until(lambda: books() != before, 0.5), "something goes round"
    assert sorted(there.received()) == sorted(2 * said)
    assert sorted(here.received()) == sorted(3 * said)


@pytest.fixture
def ros() -> Iterator[tuple[int, RosPeers]]:
    """A domain over DDS, and a program with typed publishers and subscriptions on it."""
    pytest.importorskip("rclpy", reason="rclpy is not installed: there is no ROS to join")
    from beacon_ros.domains import DomainLease  # noqa: PLC0415
    from beacon_ros_topic.relay.harness import Peers as RosPeers  # noqa: PLC0415

    with DomainLease() as lease:
        peers = RosPeers(lease.domain_id)
        yield lease.domain_id, peers
        peers.close()


def dds(domain: int) -> str:
    return f"{{adapter: ros, options: {{domain_id: {domain}}}}}"


def test_a_typed_ros_talker_is_heard_over_zenoh_with_the_same_bytes(
    plant: Plant, ros: tuple[int, RosPeers], site: RmwTopicSideHarness
) -> None:
    from rclpy.serialization import serialize_message  # noqa: PLC0415
    from std_msgs.msg import String, UInt8MultiArray  # noqa: PLC0415

    domain, peers = ros
    conduit = free_endpoint()
    at_site = plant.end("site", beside(site), f"listen: [{conduit}]", "republish: true")
    plant.end("robot", dds(domain), f"connect: [{conduit}]", RULES)
    talker = peers.node.create_publisher(String, "/chatter", 100)
    camera = peers.node.create_publisher(UInt8MultiArray, "/image", 10)
    heard = site.peers.subscription("/robot/chatter", TEXT, RELIABLE)
    seen = site.peers.subscription("/robot/image", BYTES, RELIABLE)
    live = {"/robot/chatter": "live", "/robot/image": "live"}
    eventually(lambda: at_site.published() == live, "both are published")
    for publisher in (talker, camera):
        eventually(publisher.get_subscription_count, "the relay listens")
    said = [String(data=f"text {number} é") for number in range(20)]
    for one in said:
        talker.publish(one)
    camera.publish(UInt8MultiArray(data=MEBIBYTE))
    eventually(lambda: len(heard.received()) >= len(said), "the texts", 10)
    eventually(seen.received, "the image", 10)
    assert heard.received() == [padded(serialize_message(one)) for one in said]
    assert seen.received() == [message(MEBIBYTE)]


def test_what_is_said_over_zenoh_is_heard_by_typed_ros_nodes_also_late(
    plant: Plant, robot: RmwTopicSideHarness, ros: tuple[int, RosPeers]
) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: PLC0415
    from std_msgs.msg import String  # noqa: PLC0415

    domain, peers = ros
    conduit = free_endpoint()
    at_site = plant.end("site", dds(domain), f"listen: [{conduit}]", "republish: true")
    plant.end("robot", beside(robot), f"connect: [{conduit}]", RULES)
    chatter = robot.peers.publisher("/chatter", TEXT, RELIABLE)
    camera = robot.peers.publisher("/image", BYTES, RELIABLE)
    robot.peers.publisher("/map", TEXT, LATCHED).publish(text("the map"))
    heard: list[str] = []
    take = lambda one: heard.append(one.data)  # noqa: E731
    peers.run(lambda: peers.node.create_subscription(String, "/robot/chatter", take, 100))
    seen = peers.subscription("/robot/image", RELIABLE)
    live = {"/robot/chatter": "live", "/robot/image": "live", "/robot/map": "live"}
    eventually(lambda: at_site.published() == live, "all are published")
    # Both ends of a DDS match may say so before anything gets through.
    says_hello(lambda: chatter.publish(text("hello")), lambda: heard)
    says_hello(lambda: camera.publish(message(b"hello")), seen.received)
    words = [f"text {number} é" for number in range(20)]
    for one in words:
        chatter.publish(text(one))
    camera.publish(message(MEBIBYTE))
    eventually(lambda: words[-1] in heard, "the texts", 10)
    eventually(lambda: message(MEBIBYTE) in seen.received(), "the image", 10)
    assert [one for one in heard if one != "hello"] == words
    assert [one for one in seen.received() if one != message(b"hello")] == [message(MEBIBYTE)]
    maps: list[str] = []
    late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    keep = lambda one: maps.append(one.data)  # noqa: E731
    peers.run(lambda: peers.node.create_subscription(String, "/robot/map", keep, late))
    eventually(lambda: maps == ["the map"], "the map", 10)


def test_bytes_come_back_unchanged_after_two_middlewares(
    plant: Plant, robot: RmwTopicSideHarness, ros: tuple[int, RosPeers]
) -> None:
    """From Zenoh to DDS and back to Zenoh, a type that is installed nowhere."""
    domain, _ = ros
    of = TopicType("made_up_msgs/msg/Thing", f"RIHS01_{'5a' * 32}")
    there, back = free_endpoint(), free_endpoint()
    onto = plant.end("onto", dds(domain), f"listen: [{there}]", "republish: true")
    plant.end("out", beside(robot), f"connect: [{there}]", "forward: [{allow: /t, to: /d/t}]")
    home = plant.end("home", beside(robot), f"listen: [{back}]", "republish: true")
    plant.end("away", dds(domain), f"connect: [{back}]", "forward: [{allow: /d/t, to: /b/t}]")
    speaker = robot.peers.publisher("/t", of, RELIABLE)
    ear = robot.peers.subscription("/b/t", of, RELIABLE)
    eventually(lambda: onto.published() == {"/d/t": "live"}, "there")
    eventually(lambda: home.published() == {"/b/t": "live"}, "and back")
    hello = b"\0\1\0\0" + b"hell"
    # Both ends of a DDS match may say so before anything gets through.
    says_hello(lambda: speaker.publish(hello), ear.received)
    sent = [b"\0\1\0\0" + bytes([number]) * 4 * number for number in range(1, 30)]
    for one in sent:
        speaker.publish(one)
    eventually(lambda: sent[-1] in ear.received(), "all come back", 10)
    assert [one for one in ear.received() if one != hello] == sent


def padded(payload: bytes) -> bytes:
    """As DDS fills up what goes through a socket."""
    return payload + bytes(-len(payload) % 4)
