"""An independent implementation of rmw_zenoh's wire and ours, side by side over a router.

The peer is zenoh-ros2-sdk, in a virtual environment of its own. It is given its definitions as
files, no git, no search path and an empty home, so that it can neither fetch anything nor write
into the home of whoever runs this.
"""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
import zenoh

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.parameters.fields import PREFIX, write
from beacon_core.ports.health import Condition
from beacon_core.relay.effects import CreatePublisher, Publish, Subscribe
from beacon_core.testing.harness import Listener
from beacon_core.testing.relay.topic_harness import Watching
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.rmw import RmwOptions
from beacon_zenoh.rmw.announcer import RmwTopicAnnouncer
from beacon_zenoh.rmw.harness import RmwHarness
from beacon_zenoh.rmw.tokens import Kind
from beacon_zenoh.rmw_param.harness import RmwParamHarness
from beacon_zenoh.rmw_relay import RmwNetworkOptions
from beacon_zenoh.rmw_relay.topic_side import RmwTopicSide

# Making the environment takes half a minute, and more where the package index is slow.
pytestmark = [pytest.mark.timeout(600), pytest.mark.system]

HERE = Path(__file__).parent
DEFINITIONS = HERE.parent / "data" / "rmw_zenoh" / "definitions"
SDK = "zenoh-ros2-sdk==0.1.8"
TOPIC = "/ros2_medkit/discovery"
TRANSIENT_LOCAL = ":1:,10:,:,:,,"


@pytest.fixture(scope="session")
def peer_python(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python that has the SDK; kept from run to run where pytest has a cache."""
    cache = getattr(request.config, "cache", None)
    folder = cache.mkdir("rmw-zenoh-peer") if cache else tmp_path_factory.mktemp("peer")
    python = Path(folder) / f"py{sys.version_info.minor}-sdk-0.1.8" / "bin" / "python"
    with Path(folder, "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # workers side by side make one, not several
        if not made(python):
            make(python)
    return python


def made(python: Path) -> bool:
    check = [str(python), "-c", "import zenoh, rosbags, zenoh_ros2_sdk"]
    environment = bare(python.parent)
    return python.exists() and not subprocess.run(check, env=environment, check=False).returncode


def make(python: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", str(python.parents[1])], check=True)
    wanted = [SDK, f"eclipse-zenoh=={version('eclipse-zenoh')}"]
    install = [str(python), "-m", "pip", "install", "--quiet", *wanted]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"{SDK} cannot be installed: {done.stderr.strip()[-300:]}")


def bare(home: Path) -> dict[str, str]:
    """An environment without git, without a search path, and with a home of its own."""
    return {
        "HOME": str(home),
        "PATH": "/nowhere",
        "GIT_PYTHON_GIT_EXECUTABLE": "/nowhere/git",
        "GIT_PYTHON_REFRESH": "quiet",
        "GIT_CONFIG_GLOBAL": os.devnull,
    }


class Peer:
    """The SDK's process."""

    def __init__(self, python: Path, endpoint: str, domain: int, home: Path) -> None:
        port = endpoint.rpartition(":")[2]
        script = str(HERE / "peers" / "sdk_peer.py")
        self.process = subprocess.Popen(
            [str(python), script, port, str(domain), str(DEFINITIONS)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=bare(home),
            text=True,
        )
        self.heard: list[dict[str, Any]] = []
        self._answers: list[object] = []
        self._answered = threading.Semaphore(0)
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()
        self._wait()

    def say(self, *words: object) -> Any:
        """Tell it to do something, and return what it answers."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(words) + "\n")
        self.process.stdin.flush()
        return self._wait()

    def publish(self, node: str = "talker", qos: str | None = None, **hint: object) -> None:
        """Let it say a hint."""
        assert self.say("publish", node, qos, hint) == "published"

    def kill_process(self) -> None:
        """End it without a goodbye."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(10)

    def kill(self) -> None:
        """End it, and forget it."""
        self.kill_process()
        self._reading.join(10)
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            stream.close()

    def _wait(self) -> object:
        assert self._answered.acquire(timeout=30), "the peer does not answer"
        return self._answers.pop(0)

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("{"):
                told = json.loads(line)
                if "heard" in told:
                    self.heard.append(told["heard"])
                else:
                    self._answers.append(told["answer"])
                    self._answered.release()


@pytest.fixture
def harness() -> Iterator[RmwHarness]:
    made_here = RmwHarness()
    yield made_here
    made_here.close()


@pytest.fixture
def start(peer_python: Path, harness: RmwHarness, tmp_path: Path) -> Iterator[Callable[[], Peer]]:
    """Starts peers in the harness's first domain; none of them may leave anything in its home."""
    peers: list[Peer] = []

    def started() -> Peer:
        peers.append(Peer(peer_python, harness.endpoint, 0, tmp_path))
        return peers[-1]

    yield started
    for peer in peers:
        peer.kill()
    assert not list(tmp_path.iterdir()), "it wrote into its home"


def eventually(harness: RmwHarness, predicate: Callable[[], bool], seconds: float = 5.0) -> None:
    assert harness.wait_until(predicate, seconds)


def test_what_it_publishes_is_stored(harness: RmwHarness, start: Callable[[], Peer]) -> None:
    listener = Listener(harness).start()
    peer = start()
    peer.publish(
        entity_id="engine",
        display_name="Engine 🚗",
        function_ids=["drive"],
        depends_on=["fuel", "air"],
        process_id=4711,
        hostname="robot-1",
        metadata={"mode": "idle"},
    )
    eventually(harness, lambda: listener.has("engine"))
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.hint == BeaconHint(
        "engine",
        display_name="Engine 🚗",
        function_ids=("drive",),
        depends_on=("fuel", "air"),
        process_id=4711,
        hostname="robot-1",
        metadata={"mode": "idle"},
    )
    (call,) = listener.tap.calls
    assert call.source == call.incarnation
    assert call.stamp_ns > 0


def test_its_nodes_are_in_our_graph_and_ours_in_its(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    listener = Listener(harness).start()
    graph = listener.source.graph  # type: ignore[attr-defined]
    harness.announcer().announce(BeaconHint("ours"))
    peer = start()
    peer.publish(entity_id="engine")
    peer.say("subscribe", "ear", None)

    def theirs() -> list[str]:
        return [view.node.node_name for view in graph.nodes() if "/fleet" in view.node.namespace]

    eventually(harness, lambda: theirs() == ["/fleet/r1/ear", "/fleet/r1/talker"])
    talker = next(view for view in graph.nodes() if view.node.node == "talker")
    (publisher,) = talker.of(Kind.PUBLISHER)
    assert (publisher.name, publisher.qos.depth) == (TOPIC, 10)
    seen = peer.say("graph", TOPIC)
    assert any("beacon_announcer" in name for name in seen["publishers"])
    assert any("beacon_gateway" in name for name in seen["subscribers"])
    assert seen["hashes"] == [TYPE_HASH]
    peer.say("end", "talker")
    eventually(harness, lambda: theirs() == ["/fleet/r1/ear"], 2.0)


class BesideIt(RmwParamHarness):
    """Parameters over the same router."""

    def __init__(self, endpoint: str) -> None:
        super().__init__()
        self._endpoint = endpoint

    @property
    def endpoint(self) -> str:
        return self._endpoint


@pytest.fixture
def asking(harness: RmwHarness) -> Iterator[RmwParamHarness]:
    made = BesideIt(harness.endpoint)
    yield made
    made.close()


def test_it_is_asked_for_its_parameters(
    harness: RmwHarness, asking: RmwParamHarness, start: Callable[[], Peer]
) -> None:
    listener = Listener(asking).start()
    hint = BeaconHint("engine", display_name="Motör 🚗", metadata={"vendor": "acme"})
    assert start().say("declare", "talker", dict(write(hint))) == "declared"
    eventually(harness, lambda: listener.has("engine"))
    stored = listener.store.get("engine")
    assert stored is not None
    assert (stored.hint, stored.source) == (hint, "/fleet/r1/talker")


def test_it_asks_what_we_announce_as_parameters(
    harness: RmwHarness, asking: RmwParamHarness, start: Callable[[], Peer]
) -> None:
    announcer = asking.announcer()
    hint = BeaconHint("brake", display_name="Bremse", metadata={"a": "b"})
    announcer.announce(hint)
    listener = Listener(asking).start()
    eventually(harness, lambda: listener.has("brake"))
    stored = listener.store.get("brake")
    assert stored is not None
    assert start().say("ask", stored.source, PREFIX) == write(hint)


def test_it_hears_what_we_announce(harness: RmwHarness, start: Callable[[], Peer]) -> None:
    peer = start()
    peer.say("subscribe", "ear", None)
    announcer = harness.announcer()
    said = BeaconHint("brake", display_name="Bremse", depends_on=("oil",), metadata={"a": "b"})
    announcer.announce(said)
    eventually(harness, lambda: bool(peer.heard))
    assert peer.heard == [
        {
            "entity_id": "brake",
            "display_name": "Bremse",
            "depends_on": ["oil"],
            "process_id": 0,
            "metadata": {"a": "b"},
        }
    ]


def test_it_hears_what_we_announced_before_it_came(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    # It looks for publishers that keep their words on topics without a second "/" only; and takes
    # one answer for each key, so of several entities it hears one.
    announcer = RmwTopicAnnouncer(RmwOptions(connect=(harness.endpoint,), topic="/hints"))
    announcer.announce(BeaconHint("gone"))
    announcer.announce(BeaconHint("brake", display_name="old"))
    announcer.announce(BeaconHint("brake", display_name="new"))
    announcer.withdraw("gone")
    up = lambda: announcer.health().condition is Condition.UP  # noqa: E731
    eventually(harness, up)
    peer = start()
    peer.say("subscribe", "ear", TRANSIENT_LOCAL, "/hints")
    eventually(harness, lambda: bool(peer.heard))
    assert [(one["entity_id"], one["display_name"]) for one in peer.heard] == [("brake", "new")]
    announcer.close()


def test_when_it_is_killed_its_hints_are_stale_at_once_though_its_numbers_are_random(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    listener = Listener(harness).start()
    doomed, other = start(), start()
    doomed.publish(entity_id="engine")
    other.publish(entity_id="brake")
    eventually(harness, lambda: listener.has("engine") and listener.has("brake"))
    tied = lambda: all(  # noqa: E731
        one.token is not None
        for one in listener.source._publishers.heard.values()  # type: ignore[attr-defined]
    )
    eventually(harness, tied)
    doomed.kill_process()
    eventually(harness, lambda: listener.has("engine", Status.STALE), 2.0)
    stored = listener.store.get("engine")
    assert stored is not None
    assert stored.cause is Cause.LOST
    assert stored.detail == "its node left the ROS graph without a goodbye"
    assert listener.has("brake")


def test_a_node_taken_down_in_order_is_missed_too(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    listener = Listener(harness).start()
    peer = start()
    peer.publish(entity_id="engine")
    eventually(harness, lambda: listener.has("engine"))
    eventually(harness, lambda: listener.source._publishers.next_due_ns() is None)  # type: ignore[attr-defined]
    peer.say("end", "talker")
    eventually(harness, lambda: listener.has("engine", Status.STALE), 2.0)


def test_namespaces_that_are_not_wanted_are_not_heard(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    listener, fleet = Listener(harness), Listener(harness)
    but = ("/fleet/r1",)
    options = RmwOptions(connect=(harness.endpoint,), except_namespaces=but)
    listener.source = harness.adapter.source(options)
    listener.start()
    fleet.start()
    start().publish(entity_id="engine")
    eventually(harness, lambda: fleet.has("engine"))
    refused = lambda: listener.source.health().counters["not-admitted"] == 1  # noqa: E731
    eventually(harness, refused)
    assert listener.status("engine") is None
    listener.source.close()


def test_a_relay_beside_it_carries_both_ways(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    side, watching = RmwTopicSide(RmwNetworkOptions(connect=(harness.endpoint,))), Watching()
    side.start(watching)
    peer = start()
    peer.publish(entity_id="engine")
    eventually(harness, lambda: TOPIC in watching.topics)
    seen = watching.topics[TOPIC]
    assert (seen.type.name, seen.type.digest) == (TYPE_NAME, TYPE_HASH)
    side.subscribe(Subscribe(1, TOPIC, seen.type, seen.qos))

    def heard() -> bool:
        peer.publish(entity_id="engine")
        return bool(watching.heard)

    eventually(harness, heard)
    (message, *_) = watching.heard
    read = cdr.decode(message.payload)
    assert isinstance(read, Announcement)
    assert read.hint == BeaconHint("engine")
    assert (message.first, message.hop) == (0, 0)
    peer.say("subscribe", "ear", None)
    side.create_publisher(CreatePublisher(2, TOPIC, seen.type, seen.qos, first=1))
    eventually(harness, lambda: watching.last_match(2) == (1, 1))
    said = cdr.encode(BeaconHint("brake", display_name="Bremse"))
    side.publish(Publish(2, said, 0, first=1, hop=1))
    eventually(harness, lambda: "brake" in [one["entity_id"] for one in peer.heard])
    side.close()


def test_kept_frames_are_what_it_sends_today(
    harness: RmwHarness, start: Callable[[], Peer]
) -> None:
    """But for what is new in each run: session, GID and times."""
    seen = list[tuple[str, bytes, int]]()
    assert harness.endpoint
    assert harness._router is not None
    session: zenoh.Session = harness._router[0]

    def take(sample: zenoh.Sample) -> None:
        beside = sample.attachment
        length = 0 if beside is None else len(beside.to_bytes())
        seen.append((str(sample.key_expr), sample.payload.to_bytes(), length))

    session.declare_subscriber("**", take)
    session.liveliness().declare_subscriber("@ros2_lv/**", take, history=True)
    text = (DEFINITIONS.parent / "frames.jsonl").read_text("utf-8")
    kept = [json.loads(line) for line in text.splitlines()]
    peer = start()
    peer.publish(entity_id="engine", display_name="Engine", metadata={"mode": "idle"})
    peer.say("subscribe", "ear", TRANSIENT_LOCAL)
    eventually(harness, lambda: len(seen) >= len(kept))
    zid = next(key.split("/")[2] for key, _, _ in seen if key.startswith("@ros2_lv"))

    def plain(key: str, payload: bytes, length: int) -> tuple[str, str, int]:
        return key.replace(zid, "ZID"), payload.hex(), length

    expected = {(one["key"], one["payload"], len(one["attachment"]) // 2) for one in kept}
    assert {plain(*one) for one in seen} == expected
