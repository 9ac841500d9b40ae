"""Images from one ROS domain to another through two topic sides, against a bare raw forwarder.

    python bench/relay_ros.py

Two processes on one machine and real DDS over UDP. One publishes 1 MiB images on one domain and
subscribes to them on another; no more than four are under way. The other forwards them, by turns
with rclpy alone (``raw=True``, ``publish(bytes)``, its fastest executor) and with a topic side on
each domain, whose messages are handed over as the relay's core would. The ratio is that of the
images that got through; that of the forwarding process's time for each is shown beside it.

And what 500 topics cost that are subscribed to on one domain and offered on the other, and quiet.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import attrs
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.task import Future

from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.values import Qos, TopicType
from beacon_ros.domains import DomainLease
from beacon_ros.participant import OwnNode
from beacon_ros_topic.relay.options import RosNetworkOptions
from beacon_ros_topic.relay.qos import profile
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.topic_side import RosTopicSide
from measure import Report, options

AT_LEAST = 0.8
IDLE_AT_MOST = 0.02
ROUTES = 500

TOPIC = "/image"
QOS = Qos(reliable=True, durable=False, depth=10)
BYTES = TopicType(
    "std_msgs/msg/UInt8MultiArray",
    "RIHS01_5687e861b8d307a5e48b7515467ae7a5fc2daf805bd0ce6d8e9e604bade9f385",
)

ENDS = """
import select, struct, sys, time
sys.path.insert(0, "bench")
from relay_ros import BYTES, QOS, TOPIC
from beacon_ros.participant import OwnNode
from beacon_ros.taking import Buffer
from beacon_ros_topic.relay.hub import Hub
from beacon_ros_topic.relay.intake import Intake
from beacon_ros_topic.relay.qos import profile
from beacon_ros_topic.relay.rawtypes import type_for
from beacon_ros_topic.relay.voice import Voice
here, there, seconds = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
got = []
image = b"\\0\\1\\0\\0" + struct.pack("<III", 0, 0, 2**20) + bytes(range(256)) * 4096
out, back = OwnNode("bench", here), OwnNode("bench", there)
voice = Voice(out.node, type_for(BYTES), TOPIC, profile(QOS, 10))
hub = Hub(back.context, lambda: None, lambda: intake.close())
tell = lambda payload, gid, stamp: got.append(len(payload))
buffer = Buffer(2**24)
intake = Intake(back.node, type_for(BYTES), TOPIC, profile(QOS, 10), buffer, tell)
hub.do(lambda: intake.open(hub))
hub.start()
deadline = time.monotonic() + 20
while not got and time.monotonic() < deadline:
    voice.send(image)
    time.sleep(0.1)
time.sleep(0.5)
print("begun", flush=True)
lost, done, began = 0, len(got), time.perf_counter()
sent, start = done, done
while time.perf_counter() < began + seconds:
    if sent - len(got) - lost < 4:
        voice.send(image)
        sent, waited = sent + 1, time.perf_counter()
    elif time.perf_counter() > waited + 0.5:
        lost = sent - len(got)
    else:
        time.sleep(0.0002)
assert set(got) == {len(image)}
print((len(got) - start) / seconds, lost, flush=True)
hub.close(1.0)
voice.close()
out.close(), back.close()
"""

MANY = """
import sys
sys.path.insert(0, "bench")
from relay_ros import BYTES, QOS, ROUTES
from beacon_ros.participant import OwnNode
from beacon_ros_topic.relay.qos import profile
from beacon_ros_topic.relay.rawtypes import type_for
own = OwnNode("bench", int(sys.argv[1]))
for number in range(ROUTES):
    own.node.create_publisher(type_for(BYTES), f"/quiet_{number}", profile(QOS, 1))
print("made", flush=True)
sys.stdin.readline()
own.close()
"""


@attrs.frozen
class Result:
    images: float
    """That came through each second; so many MiB a second."""
    lost: int
    cpu_ms: float
    """Processor time of the forwarding process for each."""


class Handing:
    """A watcher that does with what it is told what a relay would, and nothing else."""

    def __init__(self, to: RosTopicSide) -> None:
        self.seen: dict[str, SeenTopic] = {}
        self._to = to

    def topic_seen(self, topic: str, seen: SeenTopic) -> None:
        self.seen[topic] = seen

    def topic_gone(self, topic: str) -> None:
        self.seen.pop(topic, None)

    def message(
        self, handle: int, payload: bytes, *, stamp_ns: int = 0, first: int = 0, hop: int = 0
    ) -> None:
        self._to.publish(Publish(handle, payload, stamp_ns, first or 1, hop + 1))

    def matched(self, handle: int, matched: int, expected: int) -> None: ...

    def publisher_failed(self, handle: int, reason: str) -> None:
        raise RuntimeError(f"{handle}: {reason}")


@contextmanager
def bare(here: int, there: int) -> Iterator[None]:
    """A raw subscription whose callback publishes."""
    one, other = OwnNode("bench", here), OwnNode("bench", there)
    message = type_for(BYTES)
    publisher = other.node.create_publisher(message, TOPIC, profile(QOS, 10))
    one.node.create_subscription(message, TOPIC, publisher.publish, profile(QOS, 10), raw=True)
    spinning, stop = EventsExecutor(context=one.context), Future()
    spinning.add_node(one.node)
    # With a time-out: without one it may take a whole core and never end.
    forever: dict[str, Any] = {"timeout_sec": 1e6}
    thread = threading.Thread(
        target=spinning.spin_until_future_complete, args=(stop,), kwargs=forever
    )
    thread.start()
    yield
    stop.set_result(None)
    thread.join()
    spinning.shutdown()
    one.close()
    other.close()


@contextmanager
def sides(here: int, there: int) -> Iterator[tuple[RosTopicSide, RosTopicSide, Handing]]:
    """Two topic sides; what comes in at one goes out at the other."""
    one = RosTopicSide(RosNetworkOptions(domain_id=here, queue=10))
    other = RosTopicSide(RosNetworkOptions(domain_id=there, queue=10))
    handing = Handing(other)
    other.start(Handing(one))
    one.start(handing)
    yield one, other, handing
    one.close()
    other.close()


@contextmanager
def relay(here: int, there: int) -> Iterator[None]:
    """Two topic sides with one route."""
    with sides(here, there) as (one, other, _):
        other.create_publisher(CreatePublisher(1, TOPIC, BYTES, QOS, 1))
        one.subscribe(Subscribe(1, TOPIC, BYTES, QOS))
        yield


def measured(subject: Callable[[int, int], Any], seconds: float) -> Result:
    """Send images round for so long."""
    with DomainLease() as here, DomainLease() as there:
        numbers = map(str, (here.domain_id, there.domain_id, seconds))
        with (
            subject(here.domain_id, there.domain_id),
            subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-c", ENDS, *numbers], stdout=subprocess.PIPE
            ) as ends,
        ):
            assert ends.stdout is not None
            ends.stdout.readline()
            began = time.process_time()
            rate, lost = map(float, ends.stdout.readline().split())
            cpu_s = time.process_time() - began
            ends.wait(10)
    return Result(rate, int(lost), cpu_s / max(1.0, rate * seconds) * 1000)


def quiet(seconds: float) -> tuple[float, float]:
    """The part of a core that 500 quiet routes take, and the seconds until all were seen."""
    with ExitStack() as stack:
        here, there = (stack.enter_context(DomainLease()) for _ in range(2))
        many = stack.enter_context(
            subprocess.Popen(  # noqa: S603 - ourselves
                [sys.executable, "-c", MANY, str(here.domain_id)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
        )
        assert many.stdout is not None
        many.stdout.readline()
        began = time.monotonic()
        one, other, handing = stack.enter_context(sides(here.domain_id, there.domain_id))
        while sum(topic.startswith("/quiet_") for topic in handing.seen) < ROUTES:
            time.sleep(0.01)
        seen_s = time.monotonic() - began
        for number in range(1, ROUTES + 1):
            topic = f"/quiet_{number - 1}"
            other.create_publisher(CreatePublisher(number, topic, BYTES, QOS, 1))
            one.subscribe(Subscribe(number, topic, BYTES, QOS))
        time.sleep(8.0)
        began, began_cpu = time.perf_counter(), time.process_time()
        time.sleep(seconds)
        share = (time.process_time() - began_cpu) / (time.perf_counter() - began)
        many.communicate(b"\n")
    return share, seen_s


def main() -> None:
    arguments = options()
    rounds, seconds = (1, 1.0) if arguments.quick else (5, 3.0)
    report = Report("1 MiB images from one ROS domain to another / a bare raw forwarder")
    subjects = {"bare": bare, "relay": relay}
    results: dict[str, list[Result]] = {name: [] for name in subjects}
    for _ in range(rounds):
        for name, subject in subjects.items():
            results[name].append(measured(subject, seconds))
    images = {name: statistics.median(one.images for one in some) for name, some in results.items()}
    cpu = {name: statistics.median(one.cpu_ms for one in some) for name, some in results.items()}
    report.ratio("time for each image that came through", images["bare"] / images["relay"], 1.25)
    report.ratio("processor time for each", cpu["relay"] / cpu["bare"])
    for name, some in results.items():
        each = " ".join(f"{one.images:.0f}" for one in some)
        lost = sum(one.lost for one in some)
        told = f"{images[name]:6.0f} MiB/s ({each})  {cpu[name]:5.2f} ms"
        report.line(f"    {name:8} {told}  lost {lost}")
    share, seen_s = quiet(2.0 if arguments.quick else 15.0)
    report.ratio(f"of a core, {ROUTES} quiet routes", share, IDLE_AT_MOST)
    report.line(f"    {ROUTES} topics were seen after {seen_s:.2f} s")
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
