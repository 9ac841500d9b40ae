"""What the contract suite cannot see of the source: who sent what, who is not heard, endings."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no topic to hear")

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from unique_identifier_msgs.msg import UUID

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.outcome import Outcome, Verdict
from beacon_core.ports.graph import Graph
from beacon_core.ports.health import Condition
from beacon_core.ports.source import HintSource
from beacon_core.testing.harness import CLOSE_WITHIN_S, Listener, within
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME, farewell
from beacon_ros.graph import publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros_topic import RosTopicOptions, looks, roster
from beacon_ros_topic.harness import RosTopicHarness
from beacon_ros_topic.source import RosTopicSource

pytestmark = pytest.mark.system

Eventually = Callable[..., None]

TOPIC = RosTopicOptions().topic
DEEP = QoSProfile(depth=1000)
ENGINE = cdr.encode(BeaconHint("engine"))


class Sink:
    """Writes down what it is told, and does what it is told to do then."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.reasons: list[str] = []
        self.doing: Callable[[], object] = lambda: None

    def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
        announcement: Any = cdr.decode(payload)
        return self._note("offer", announcement.hint.entity_id)

    def goodbye(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        return self._note("goodbye", entity_id)

    def lost(self, entity_id: str, source: str, *, reason: str = "", **envelope: Any) -> Outcome:
        self.reasons.append(reason)
        return self._note("lost", entity_id)

    def _note(self, what: str, entity_id: str) -> Outcome:
        self.told.append(f"{what} {entity_id}")
        self.doing()
        return Outcome(Verdict.NEW, entity_id)


@pytest.fixture
def stranger(harness: RosTopicHarness) -> Iterator[OwnNode]:
    """A node in a context that is not the source's: another program, as far as DDS can tell."""
    made = OwnNode("stranger", None)
    yield made
    made.close()


@pytest.fixture
def user(harness: RosTopicHarness) -> Iterator[Node]:
    """The node of a program that already has one."""
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=harness.options().domain_id)
    made = Node("gateway", context=context, use_global_arguments=False)
    yield made
    made.destroy_node()
    context.try_shutdown()


def publisher_on(own: OwnNode, qos: QoSProfile = DEEP) -> Publisher:
    return own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), TOPIC, qos)


def met(
    publisher: Publisher, source: HintSource, eventually: Eventually, *, among: int = 1
) -> Publisher:
    """The publisher, when both ends know each other; it is one of so many."""
    eventually(publisher.get_subscription_count)
    eventually(lambda: source.health().counters["matched"] == among)
    return publisher


def test_it_tells_the_nodes_of_the_graph_until_it_is_closed(
    harness: RosTopicHarness, user: Node, stranger: OwnNode, eventually: Eventually
) -> None:
    source = RosTopicSource(harness.options())
    assert isinstance(source, Graph)
    assert source.nodes() == frozenset()
    source.start(Sink())
    try:
        name = user.get_fully_qualified_name()
        eventually(lambda: name in source.nodes())
        user.destroy_node()
        eventually(lambda: name not in source.nodes())
    finally:
        source.close()
    assert source.nodes() == frozenset()


class TestSenders:
    def test_the_sender_is_the_publisher_as_the_graph_shows_it(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        publisher = met(publisher_on(stranger), listener.source, eventually)
        (listed,) = publishers(stranger.node, TOPIC)
        before_ns = time.time_ns()
        for number in (1, 2):
            publisher.publish(cdr.encode(BeaconHint("engine", display_name=f"{number}")))
        eventually(lambda: len(listener.tap.calls) == 2)
        first, second = listener.tap.calls
        assert first.source == first.incarnation == listed.gid.hex()
        assert (second.source, second.incarnation) == (first.source, first.incarnation)
        assert (first.sequence, second.sequence) == (1, 2)
        assert before_ns <= first.stamp_ns <= second.stamp_ns <= time.time_ns()
        assert first.entity_id == ""

    def test_a_publisher_made_anew_is_another_and_the_first_does_not_end_what_it_took_over(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        first = met(publisher_on(stranger), listener.source, eventually)
        first.publish(ENGINE)
        eventually(lambda: listener.has("engine"))
        second = met(publisher_on(stranger), listener.source, eventually, among=2)
        second.publish(ENGINE)
        eventually(lambda: len(listener.tap.calls) == 2)
        stranger.node.destroy_publisher(first)
        eventually(lambda: [call.kind for call in listener.tap.calls][2:] == ["lost"])
        assert listener.has("engine")
        stranger.node.destroy_publisher(second)
        eventually(lambda: listener.has("engine", Status.STALE))

    def test_nodes_of_one_name_are_told_apart(
        self, harness: RosTopicHarness, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        owners = [OwnNode("anchor", None)]
        twins = [
            Node("twin", context=owners[0].context, use_global_arguments=False) for _ in range(2)
        ]
        for number, twin in enumerate(twins):
            made = twin.create_publisher(message_type(TYPE_NAME, TYPE_HASH), TOPIC, DEEP)
            met(made, listener.source, eventually, among=number + 1).publish(
                cdr.encode(BeaconHint(f"part-{number}"))
            )
        eventually(lambda: listener.has("part-0") and listener.has("part-1"))
        assert len({call.source for call in listener.tap.calls}) == 2
        twins[0].destroy_node()
        eventually(lambda: listener.has("part-0", Status.STALE))
        assert listener.has("part-1")
        twins[1].destroy_node()
        owners[0].close()

    def test_a_goodbye_for_somebody_elses_entity_does_not_end_it(
        self, harness: RosTopicHarness, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        harness.send_raw("engine", ENGINE, sender="owner")
        eventually(lambda: listener.has("engine"))
        harness.send_raw("engine", farewell("engine"), sender="stranger")
        harness.send_raw("other", cdr.encode(BeaconHint("other")), sender="stranger")
        eventually(lambda: listener.has("other"))
        # The store knows of it a moment before the call is over.
        eventually(lambda: len(listener.tap.calls) >= 3)
        assert [call.kind for call in listener.tap.calls] == ["offer", "goodbye", "offer"]
        assert listener.has("engine")
        harness.send_raw("engine", farewell("engine"), sender="owner")
        eventually(lambda: listener.has("engine", Status.LEFT))
        assert listener.source.health().counters["goodbyes"] == 2

    def test_who_said_goodbye_is_not_missed_when_it_goes(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        publisher = met(publisher_on(stranger), listener.source, eventually)
        for entity_id in ("engine", "brake"):
            publisher.publish(cdr.encode(BeaconHint(entity_id)))
        publisher.publish(farewell("engine"))
        eventually(lambda: listener.has("engine", Status.LEFT))
        stranger.node.destroy_publisher(publisher)
        eventually(lambda: listener.has("brake", Status.STALE))
        counters = listener.source.health().counters
        assert (counters["goodbyes"], counters["lost"]) == (1, 1)
        assert (counters["messages"], counters["publishers"]) == (3, 0)

    def test_a_process_that_is_killed_is_missed_and_it_is_said_why(
        self, harness: RosTopicHarness, eventually: Eventually
    ) -> None:
        source, sink = harness.source(), Sink()
        source.start(sink)
        announcer = harness.announcer(3600.0, mortal=True)
        announcer.announce(BeaconHint("engine"))
        eventually(lambda: "offer engine" in sink.told)
        harness.crash(announcer)
        eventually(lambda: sink.told[-1] == "lost engine")
        assert sink.reasons == ["its publisher left the ROS graph without a goodbye"]


class TestStamps:
    def test_a_stamp_in_the_message_wins_and_simulated_time_is_seen_through_and_told_once(
        self,
        harness: RosTopicHarness,
        stranger: OwnNode,
        eventually: Eventually,
        caplog: pytest.LogCaptureFixture,
    ) -> None:
        listener = Listener(harness, ttl_s=5.0).start()
        publisher = met(publisher_on(stranger), listener.source, eventually)
        for tick in range(20):
            hint = BeaconHint("engine", display_name=f"{tick}")
            publisher.publish(cdr.encode(hint, 42 * 10**9 + tick * 10**6))
        eventually(lambda: listener.says("engine", "19"))
        assert listener.has("engine")
        assert {call.stamp_ns for call in listener.tap.calls} == {0}
        told = [record for record in caplog.records if "its clock is" in record.getMessage()]
        assert len(told) == 1
        assert "s behind ours" in told[0].getMessage()

    def test_where_the_middleware_numbers_no_messages_they_have_no_number(
        self, harness: RosTopicHarness
    ) -> None:
        listener = Listener(harness)
        listener.start()
        source: Any = listener.source
        source.on_message(ENGINE, b"g" * 16, 2**64 - 1, 0)  # as rmw says "not supported"
        (call,) = listener.tap.calls
        assert call.sequence == 0


class TestWhoIsNotHeard:
    @pytest.fixture(autouse=True)
    def _often(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Now and then, and not when something was said: nothing is said when these go."""
        monkeypatch.setattr(looks, "_AFTER_S", ())
        monkeypatch.setattr(looks, "_EVERY_S", 0.05)

    def complaint(self, listener: Listener) -> str:
        health = listener.source.health()
        assert health.condition is (Condition.DEGRADED if health.detail else Condition.UP)
        return health.detail

    def test_a_publisher_that_does_not_fit_is_named_until_it_goes(
        self,
        harness: RosTopicHarness,
        stranger: OwnNode,
        eventually: Eventually,
        caplog: pytest.LogCaptureFixture,
    ) -> None:
        listener = Listener(harness).start()
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        publisher = publisher_on(stranger, qos)
        said = (
            f"/{stranger.node.get_name()} is not heard: it offers reliability best_effort, this "
            "source wants reliable; set reliability: best_effort here, or reliable there"
        )
        eventually(lambda: self.complaint(listener) == said)
        eventually(lambda: listener.source.health().counters["incompatible"] == 1)
        stranger.node.destroy_publisher(publisher)
        eventually(lambda: self.complaint(listener) == "")
        lines = [one.getMessage() for one in caplog.records if one.levelno == logging.WARNING]
        assert lines.count(f"{TOPIC}: {said}") == 1

    def test_so_is_one_that_does_not_keep_what_it_said_if_the_source_wants_that(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        options = RosTopicOptions(
            domain_id=harness.options().domain_id, durability="transient_local"
        )
        source = RosTopicSource(options)
        source.start(Sink())
        publisher_on(stranger)
        eventually(
            lambda: "offers durability volatile, this source wants" in source.health().detail
        )
        source.close()

    def test_so_is_one_of_another_type(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        publisher = stranger.node.create_publisher(UUID, TOPIC, DEEP)
        said = (
            f"/{stranger.node.get_name()} is not heard: it publishes "
            "unique_identifier_msgs/msg/UUID, not ros2_medkit_msgs/msg/MedkitDiscoveryHint"
        )
        eventually(lambda: self.complaint(listener) == said)
        stranger.node.destroy_publisher(publisher)
        eventually(lambda: self.complaint(listener) == "")

    def test_of_many_three_are_named(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        for _ in range(5):
            stranger.node.create_publisher(UUID, TOPIC, DEEP)
        eventually(lambda: self.complaint(listener).endswith("; and 2 more"))
        assert self.complaint(listener).count("is not heard") == 3


class TestJoined:
    """A source on a node that the program already has."""

    @pytest.fixture
    def sink(self) -> Sink:
        return Sink()

    @pytest.fixture
    def source(self, harness: RosTopicHarness, user: Node, sink: Sink) -> Iterator[RosTopicSource]:
        made = RosTopicSource(harness.options(), node=user)
        made.start(sink)
        yield made
        made.close()

    def test_it_needs_nobody_to_spin_the_node(
        self, source: RosTopicSource, sink: Sink, stranger: OwnNode, eventually: Eventually
    ) -> None:
        met(publisher_on(stranger), source, eventually).publish(ENGINE)
        eventually(lambda: sink.told == ["offer engine"])

    def test_it_takes_nothing_away_from_who_spins_the_node_and_hears_the_same_topic(
        self,
        source: RosTopicSource,
        sink: Sink,
        user: Node,
        stranger: OwnNode,
        eventually: Eventually,
    ) -> None:
        own: list[bytes] = []
        made = message_type(TYPE_NAME, TYPE_HASH)
        subscription = user.create_subscription(made, TOPIC, own.append, DEEP, raw=True)
        executor = SingleThreadedExecutor(context=user.context)
        executor.add_node(user)
        publisher = publisher_on(stranger)
        eventually(subscription.get_publisher_count)
        eventually(lambda: source.health().counters["matched"])
        eventually(lambda: publisher.get_subscription_count() == 2)
        for number in range(300):
            publisher.publish(cdr.encode(BeaconHint(f"part-{number}")))

        def both() -> bool:
            executor.spin_once(timeout_sec=0.01)
            return len(own) >= 300 and len(sink.told) >= 300

        eventually(both)
        executor.shutdown()
        assert own == [cdr.encode(BeaconHint(f"part-{number}")) for number in range(300)]
        assert sink.told == [f"offer part-{number}" for number in range(300)]

    def test_a_context_shut_down_behind_its_back_is_told_by_its_health_alone(
        self,
        source: RosTopicSource,
        user: Node,
        eventually: Eventually,
        capfd: pytest.CaptureFixture[str],
        caplog: pytest.LogCaptureFixture,
    ) -> None:
        user.context.shutdown()
        eventually(lambda: source.health().condition is Condition.DOWN, 1.0)
        assert source.health().detail == "the ROS context was shut down; start the gateway again"
        within(CLOSE_WITHIN_S, source.close)
        assert source.health().condition is Condition.CLOSED
        assert capfd.readouterr() == ("", "")
        assert [one for one in caplog.records if one.levelno > logging.INFO] == []

    def test_so_is_a_node_that_was_destroyed_also_in_the_midst_of_messages(
        self,
        source: RosTopicSource,
        sink: Sink,
        user: Node,
        stranger: OwnNode,
        eventually: Eventually,
        caplog: pytest.LogCaptureFixture,
    ) -> None:
        publisher = met(publisher_on(stranger), source, eventually)
        for number in range(2000):
            publisher.publish(ENGINE)
            if number == 1000:
                user.destroy_node()
        eventually(lambda: source.health().condition is Condition.DOWN)
        assert source.health().detail == "its ROS node was destroyed; start the gateway again"
        within(CLOSE_WITHIN_S, source.close)
        assert [one for one in caplog.records if one.levelno > logging.INFO] == []

    def test_a_topic_that_this_program_has_with_another_type_is_refused(
        self, harness: RosTopicHarness, user: Node
    ) -> None:
        user.create_publisher(UUID, TOPIC, DEEP)
        source = RosTopicSource(harness.options(), node=user)
        with pytest.raises(ConfigError, match=f"^topic: ROS refuses '{TOPIC}': .*another type"):
            source.start(Sink())


class TestEndings:
    def test_closed_from_a_loss_it_tells_of_no_more_losses(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        source, sink = harness.source(), Sink()
        source.start(sink)
        publisher = met(publisher_on(stranger), source, eventually)
        for entity_id in ("engine", "brake", "lidar"):
            publisher.publish(cdr.encode(BeaconHint(entity_id)))
        eventually(lambda: len(sink.told) == 3)
        sink.doing = source.close
        stranger.node.destroy_publisher(publisher)
        eventually(lambda: len(sink.told) == 4)
        source.close()
        assert sink.told[3:] == ["lost engine"]

    def test_a_sink_that_hangs_holds_close_up_for_a_second_and_is_not_called_again(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        source, sink, go_on = harness.source(), Sink(), threading.Event()
        source.start(sink)
        publisher = met(publisher_on(stranger), source, eventually)
        sink.doing = go_on.wait
        for _ in range(10):
            publisher.publish(ENGINE)
        eventually(lambda: sink.told)
        within(CLOSE_WITHIN_S, source.close)
        sink.doing = lambda: None
        go_on.set()
        thread: threading.Thread = source._reader._thread  # type: ignore[attr-defined]
        eventually(lambda: not thread.is_alive())
        assert sink.told == ["offer engine"]

    def test_a_sink_that_raises_ends_nothing(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        source, sink = harness.source(), Sink()
        source.start(sink)

        def fail() -> None:
            raise RuntimeError("a defect")

        sink.doing = fail
        publisher = met(publisher_on(stranger), source, eventually)
        for _ in range(3):
            publisher.publish(ENGINE)
        publisher.publish(farewell("engine"))
        eventually(lambda: len(sink.told) == 4)
        sink.doing = lambda: None
        publisher.publish(ENGINE)
        eventually(lambda: len(sink.told) == 5)
        sink.doing = fail
        stranger.node.destroy_publisher(publisher)
        eventually(lambda: sink.told[5:] == ["lost engine"])
        eventually(lambda: source.health().counters["sink-errors"] == 5)
        assert source.health().condition is Condition.UP

    def test_it_is_started_once(self, harness: RosTopicHarness) -> None:
        source = harness.source()
        assert source.health().condition is Condition.STARTING
        source.start(Sink())
        with pytest.raises(UsageError, match="make a new one"):
            source.start(Sink())
        source.close()
        with pytest.raises(UsageError, match="make a new one"):
            source.start(Sink())

    def test_refused_by_ros_it_leaves_nothing(
        self,
        harness: RosTopicHarness,
        leaves_nothing: Callable[..., None],
    ) -> None:
        options = RosTopicOptions(topic="/ids", domain_id=harness.options().domain_id)
        other = OwnNode("other", options.domain_id)  # in the context that the source shares
        other.node.create_publisher(UUID, "/ids", DEEP)

        def refused() -> None:
            with pytest.raises(ConfigError, match="topic: ROS refuses '/ids'"):
                RosTopicSource(options).start(Sink())

        leaves_nothing(refused, 5)
        assert len(other.node.get_node_names()) == 1
        other.close()

    def test_closed_while_it_starts_it_ends_up_closed(
        self, harness: RosTopicHarness, leaves_nothing: Callable[..., None]
    ) -> None:
        def race() -> None:
            source = RosTopicSource(harness.options())

            def start() -> None:
                with suppress(UsageError):
                    source.start(Sink())

            starting = threading.Thread(target=start)
            starting.start()
            source.close()
            starting.join()
            source.close()
            assert source.health().condition is Condition.CLOSED

        leaves_nothing(race, 20)

    def test_two_sources_and_ten_announcers_are_one_participant_and_a_thread_each(
        self, harness: RosTopicHarness, threads: Callable[[], int], eventually: Eventually
    ) -> None:
        first = Listener(harness).start()
        with_one = threads()
        second = Listener(harness).start()
        for number in range(10):
            harness.announcer(3600.0).announce(BeaconHint(f"part-{number}"))
        eventually(lambda: all(len(one.tap.calls) >= 10 for one in (first, second)))
        # Of those with which it began, some may have been an earlier test's.
        eventually(lambda: threads() <= with_one + 11)

    def test_fifty_sources_with_announcers_leave_nothing(
        self,
        harness: RosTopicHarness,
        eventually: Eventually,
        leaves_nothing: Callable[..., None],
    ) -> None:
        def come_and_go() -> None:
            source, sink = RosTopicSource(harness.options()), Sink()
            source.start(sink)
            announcer = harness.adapter.announcer(harness.options(), None)
            announcer.announce(BeaconHint("engine"))
            eventually(lambda: sink.told)
            announcer.close()
            source.close()

        leaves_nothing(come_and_go)

    def test_a_program_that_ends_with_an_open_source_ends_well(
        self, run_script: Callable[[str], tuple[int, str, str]]
    ) -> None:
        assert run_script(PROGRAM + "source.start(Sink())\n") == (0, "", "")

    def test_so_does_one_that_joined_a_node_and_never_shuts_ros_down(
        self, run_script: Callable[[str], tuple[int, str, str]]
    ) -> None:
        joined = (
            "rclpy.init()\n"
            "node = rclpy.create_node('gateway')\n"
            "source = RosTopicSource(RosTopicOptions(), node=node)\n"
            "source.start(Sink())\n"
        )
        assert run_script(PROGRAM + joined) == (0, "", "")

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_so_does_one_that_spins_until_it_is_told_to_stop(
        self,
        start_script: Callable[[str], Any],
        end: Callable[[object], tuple[int, str, str]],
        number: signal.Signals,
    ) -> None:
        program = start_script(
            PROGRAM
            + "rclpy.init()\n"
            + "node = rclpy.create_node('gateway')\n"
            + "source = RosTopicSource(RosTopicOptions(), node=node)\n"
            + "source.start(Sink())\n"
            + "seen = []\n"
            + "def up(): seen or print('up', flush=True); seen.append(1)\n"
            + "node.create_timer(0.01, up)\n"
            + "try: rclpy.spin(node)\n"
            + "except (KeyboardInterrupt, Exception): pass\n"  # ROS raises the one or the other
            + "source.close()\n"
        )
        while program.stdout.readline() not in ("up\n", ""):
            pass
        program.send_signal(number)
        assert end(program) == (0, "", "")

    def test_in_a_forked_child_it_can_be_closed_and_goes_on_in_the_parent(
        self, run_script: Callable[[str], tuple[int, str, str]]
    ) -> None:
        forked = (
            "source.start(Sink())\n"
            "pid = os.fork()\n"
            "if not pid:\n"
            "    source.close(); source.health(); os._exit(0)\n"
            "assert os.waitpid(pid, 0)[1] == 0\n"
            "print(source.health().condition)\n"
            "source.close()\n"
        )
        assert run_script(PROGRAM + forked) == (0, "up\n", "")


PROGRAM = """
import os, rclpy
from beacon_core.outcome import Outcome, Verdict
from beacon_ros_topic import RosTopicOptions
from beacon_ros_topic.source import RosTopicSource

class Sink:
    def offer(self, *_, **__): return Outcome(Verdict.NEW, "x")
    goodbye = lost = offer

source = RosTopicSource(RosTopicOptions())
"""


class TestChurn:
    def test_publishers_that_come_and_go_all_the_time_leave_nothing_and_disturb_nobody(
        self,
        harness: RosTopicHarness,
        stranger: OwnNode,
        eventually: Eventually,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(roster, "UNLISTED_FOR_S", 0.2)
        monkeypatch.setattr(looks, "_EVERY_S", 0.1)
        listener = Listener(harness).start()
        quiet = met(publisher_on(stranger), listener.source, eventually)
        healthy = threading.Event()
        asking = threading.Thread(target=self.ask, args=(listener, healthy))
        asking.start()
        for number in range(150):
            publisher = publisher_on(stranger)
            publisher.publish(cdr.encode(BeaconHint(f"part-{number}")))
            quiet.publish(ENGINE)
            stranger.node.destroy_publisher(publisher)
        eventually(lambda: listener.source.health().counters["publishers"] == 1)
        healthy.set()
        asking.join()
        counters = listener.source.health().counters
        assert listener.has("engine")
        assert counters["messages"] == len([c for c in listener.tap.calls if c.kind == "offer"])
        assert counters["lost"] == len([c for c in listener.tap.calls if c.kind == "lost"])

    def ask(self, listener: Listener, enough: threading.Event) -> None:
        while not enough.wait(0.0005):
            assert listener.source.health().condition is Condition.UP

    def test_a_source_that_keeps_what_was_said_hears_it_though_it_comes_late(
        self, harness: RosTopicHarness, stranger: OwnNode, eventually: Eventually
    ) -> None:
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        publisher_on(stranger, qos).publish(ENGINE)
        options = RosTopicOptions(
            domain_id=harness.options().domain_id, durability="transient_local"
        )
        source, sink = RosTopicSource(options), Sink()
        source.start(sink)
        eventually(lambda: sink.told == ["offer engine"])
        source.close()
