"""A beacon in somebody's node: heard as long as the node is spun, and goodbye however it ends."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no nodes to speak from")

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.testing.harness import CLOSE_WITHIN_S, Listener, within
from beacon_ros.graph import publishers
from beacon_ros.participant import NO_FORK
from beacon_ros_topic.beacon import TopicBeacon
from beacon_ros_topic.harness import RosTopicHarness
from beacon_ros_topic.options import DEFAULT_TOPIC

Eventually = Callable[..., None]
Start = Callable[[str], subprocess.Popen[str]]
End = Callable[[object], tuple[int, str, str]]

ARM = BeaconHint("arm", display_name="Arm")


@pytest.fixture
def listener(harness: RosTopicHarness) -> Listener:
    return Listener(harness).start()


@pytest.fixture
def context(harness: RosTopicHarness) -> Iterator[Context]:
    made = Context()
    made.init(args=[], initialize_logging=False, domain_id=harness.options().domain_id)
    yield made
    made.try_shutdown()


@pytest.fixture
def node(context: Context) -> Iterator[Node]:
    made = Node("driver", context=context, use_global_arguments=False)
    yield made
    made.destroy_node()


@pytest.fixture
def spin(context: Context, node: Node) -> Iterator[Callable[[], None]]:
    """Spins the node a little."""
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    yield lambda: executor.spin_once(timeout_sec=0.01)
    executor.shutdown()


def heard(listener: Listener, beacon: TopicBeacon, eventually: Eventually) -> TopicBeacon:
    """The beacon, when the listener has heard it."""

    def said() -> bool:
        beacon.update()
        return listener.has(beacon.hint.entity_id)

    eventually(said)
    return beacon


def goodbyes(listener: Listener) -> int:
    """Of the calls that are over: the store knows of one a moment before."""
    return [call.kind for call in listener.tap.calls].count("goodbye")


class TestSpeaking:
    def test_it_speaks_at_once_and_says_where_it_runs(
        self, listener: Listener, node: Node, eventually: Eventually
    ) -> None:
        earlier = heard(listener, TopicBeacon(node, BeaconHint("earlier")), eventually)
        beacon = TopicBeacon(node, ARM, 3600.0)
        eventually(lambda: listener.has("arm"))
        stored = listener.store.get("arm")
        assert stored is not None
        assert stored.hint == beacon.hint
        assert stored.hint == BeaconHint(
            "arm",
            display_name="Arm",
            process_id=os.getpid(),
            process_name=Path(sys.argv[0]).name,
            hostname=socket.gethostname(),
        )
        earlier.close()

    def test_who_begins_to_listen_is_told_at_once_whatever_the_period_and_the_qos(
        self,
        harness: RosTopicHarness,
        node: Node,
        spin: Callable[[], None],
        eventually: Eventually,
    ) -> None:
        TopicBeacon(node, ARM, 3600.0)
        listeners = [Listener(harness), Listener(harness)]
        assert harness.options().durability == "volatile"

        def told(listener: Listener) -> bool:
            spin()
            return listener.has("arm")

        for listener in listeners:
            listener.start()
            eventually(lambda listener=listener: told(listener))
            listener.source.close()

    def test_it_repeats_while_it_is_spun(
        self, listener: Listener, node: Node, spin: Callable[[], None], eventually: Eventually
    ) -> None:
        TopicBeacon(node, ARM, 0.02)

        def often() -> bool:
            spin()
            return len(listener.tap.calls) >= 5

        eventually(often)
        assert len({call.payload for call in listener.tap.calls}) == 1
        numbers = [call.sequence for call in listener.tap.calls]
        assert numbers == sorted(set(numbers))

    def test_it_repeats_in_real_time_when_simulated_time_stands_still(
        self, listener: Listener, node: Node, spin: Callable[[], None], eventually: Eventually
    ) -> None:
        node.set_parameters([Parameter("use_sim_time", value=True)])
        assert node.get_clock().now().nanoseconds == 0
        TopicBeacon(node, ARM, 0.02)

        def often() -> bool:
            spin()
            return len(listener.tap.calls) >= 5

        eventually(often)
        assert listener.has("arm")
        assert node.get_clock().now().nanoseconds == 0

    def test_a_change_is_sent_at_once(
        self, listener: Listener, node: Node, eventually: Eventually
    ) -> None:
        beacon = heard(listener, TopicBeacon(node, ARM, 3600.0), eventually)
        beacon.update(display_name="Arm, hot", metadata={"celsius": "90"})
        eventually(lambda: listener.says("arm", "Arm, hot"))
        stored = listener.store.get("arm")
        assert stored is not None
        assert stored.hint == beacon.hint
        assert stored.hint.metadata == {"celsius": "90"}
        assert stored.hint.process_id == os.getpid()

    def test_what_is_no_field_is_refused(self, node: Node) -> None:
        beacon = TopicBeacon(node, ARM)
        with pytest.raises(UsageError, match=r"^update: colour, entity_id cannot be changed"):
            beacon.update(entity_id="leg", colour="red")
        assert beacon.hint.entity_id == "arm"

    def test_what_cannot_be_sent_changes_nothing(self, node: Node) -> None:
        beacon = TopicBeacon(node, ARM)
        before = beacon.hint
        with pytest.raises(UsageError, match="process_id"):
            beacon.update(process_id=-1)
        assert beacon.hint is before

    def test_an_id_that_is_none_is_refused(self, node: Node) -> None:
        with pytest.raises(UsageError, match=r"^entity_id 'a b' is no id"):
            TopicBeacon(node, BeaconHint("a b"))

    @pytest.mark.parametrize("period_s", [0, -1.0, float("nan"), float("inf")])
    def test_so_is_a_period_that_is_none(self, node: Node, period_s: float) -> None:
        with pytest.raises(ConfigError, match=r"^period_s: .* write seconds above 0"):
            TopicBeacon(node, ARM, period_s)

    def test_it_offers_what_every_listener_can_hear_unless_told_otherwise(self, node: Node) -> None:
        lossy = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        TopicBeacon(node, ARM)
        TopicBeacon(node, ARM, topic="/other", qos=lossy)
        (found,) = publishers(node, DEFAULT_TOPIC)
        assert (found.reliability, found.durability) == ("reliable", "transient_local")
        (found,) = publishers(node, "/other")
        assert (found.reliability, found.durability) == ("best_effort", "volatile")

    def test_what_else_keeps_it_from_speaking_is_raised(
        self, node: Node, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def publish(message: object) -> None:
            raise OSError("no more memory")

        beacon = TopicBeacon(node, ARM)
        monkeypatch.setattr(beacon._publisher, "publish", publish)
        with pytest.raises(OSError, match="no more memory"):
            beacon.update(display_name="x")


class TestEndings:
    @pytest.fixture
    def beacon(self, listener: Listener, node: Node, eventually: Eventually) -> TopicBeacon:
        return heard(listener, TopicBeacon(node, ARM, 3600.0), eventually)

    @pytest.mark.parametrize("ending", ["close", "destroy_node", "shutdown"])
    def test_goodbye_is_said_once(
        self,
        listener: Listener,
        context: Context,
        node: Node,
        beacon: TopicBeacon,
        eventually: Eventually,
        ending: str,
    ) -> None:
        {
            "close": beacon.close,
            "destroy_node": node.destroy_node,
            "shutdown": context.shutdown,
        }[ending]()
        eventually(lambda: listener.has("arm", Status.LEFT) and goodbyes(listener))
        beacon.close()
        context.try_shutdown()
        node.destroy_node()
        beacon.close()
        assert goodbyes(listener) == 1
        with pytest.raises(UsageError, match="closed; make a new one"):
            beacon.update(display_name="late")

    def test_all_beacons_of_a_context_say_goodbye_also_those_that_nobody_kept(
        self, listener: Listener, context: Context, eventually: Eventually
    ) -> None:
        for number in range(6):
            node = Node(f"n{number}", context=context, use_global_arguments=False)
            heard(listener, TopicBeacon(node, BeaconHint(f"part-{number}"), 3600.0), eventually)
        context.shutdown()
        eventually(lambda: all(listener.has(f"part-{n}", Status.LEFT) for n in range(6)))

    def test_a_closed_beacon_says_nothing_more(
        self,
        listener: Listener,
        node: Node,
        spin: Callable[[], None],
        eventually: Eventually,
    ) -> None:
        beacon = heard(listener, TopicBeacon(node, ARM, 0.01), eventually)
        beacon.close()
        eventually(lambda: listener.has("arm", Status.LEFT) and goodbyes(listener))
        calls = len(listener.tap.calls)
        for _ in range(10):
            spin()
        assert len(listener.tap.calls) == calls

    def test_nothing_is_left_of_fifty(
        self, node: Node, leaves_nothing: Callable[..., None]
    ) -> None:
        leaves_nothing(lambda: TopicBeacon(node, ARM).close())

    def test_what_changes_while_ros_is_shut_down_hangs_nobody(
        self, harness: RosTopicHarness
    ) -> None:
        def race(pause_s: float) -> None:
            context = Context()
            domain_id = harness.options().domain_id
            context.init(args=[], initialize_logging=False, domain_id=domain_id)
            node = Node("driver", context=context, use_global_arguments=False)
            beacon = TopicBeacon(node, ARM)

            def change() -> None:
                with suppress(UsageError):  # once it is closed
                    while True:
                        beacon.update(display_name="x")

            changing = threading.Thread(target=change)
            changing.start()
            time.sleep(pause_s)
            context.shutdown()
            changing.join()
            node.destroy_node()

        for pause_us in range(20):
            within(10.0, lambda pause_us=pause_us: race(pause_us / 1e6))  # type: ignore[misc]

    def test_ros_shut_down_without_a_word_is_no_fault_of_the_next_beat(
        self, context: Context, beacon: TopicBeacon, listener: Listener, eventually: Eventually
    ) -> None:
        handle = context.handle
        assert handle is not None
        with handle:
            handle.shutdown()  # as ROS's signal handler does
        beacon.update(display_name="nobody hears this")
        beacon.close()
        eventually(lambda: listener.has("arm", Status.LEFT))

    def test_a_signal_handler_may_shut_ros_down_in_the_midst_of_a_beat(
        self, context: Context, beacon: TopicBeacon, listener: Listener, eventually: Eventually
    ) -> None:
        with beacon._lock:  # which the beat holds that the handler interrupts
            context.shutdown()
        eventually(lambda: listener.has("arm", Status.LEFT))

    def test_a_listener_that_hangs_holds_nobody_up_for_more_than_a_second(
        self, node: Node, start_script: Start, eventually: Eventually
    ) -> None:
        gateway = start_script(GATEWAY)
        beacon = TopicBeacon(node, ARM)
        eventually(beacon._publisher.get_subscription_count)
        os.kill(gateway.pid, signal.SIGSTOP)
        for number in range(1000):
            beacon.update(display_name=f"{number}")
        within(CLOSE_WITHIN_S, beacon.close)


GATEWAY = """
import sys
from beacon_core.outcome import Outcome, Verdict
from beacon_ros_topic import RosTopicOptions
from beacon_ros_topic.source import RosTopicSource
class Sink:
    def offer(self, *_, **__): return Outcome(Verdict.NEW, "x")
    goodbye = lost = offer
source = RosTopicSource(RosTopicOptions())
source.start(Sink())
sys.stdin.readline()
"""

PROGRAM = """
import os, sys, time
import rclpy
from rclpy.node import Node
from beacon_core.hint import BeaconHint
from beacon_ros_topic.beacon import TopicBeacon

rclpy.init()
node = Node("driver")
beacon = TopicBeacon(node, BeaconHint("arm"), 0.05)
"""

SPEAKING = """
import threading
enough = threading.Event()
threading.Thread(target=lambda: (sys.stdin.readline(), enough.set())).start()
while not enough.is_set(): rclpy.spin_once(node, timeout_sec=0.05)
"""


WAYS_TO_END = ("KeyboardInterrupt", "rclpy.executors.ExternalShutdownException")


class TestPrograms:
    """Programs as somebody would write them, that end in the ways that programs end."""

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_one_that_just_spins_says_goodbye_when_it_is_told_to_stop(
        self,
        listener: Listener,
        start_script: Start,
        end: End,
        eventually: Eventually,
        number: signal.Signals,
    ) -> None:
        program = start_script(PROGRAM + "rclpy.spin(node)\n")
        eventually(lambda: len(listener.tap.calls) >= 5)
        program.send_signal(number)
        eventually(lambda: listener.has("arm", Status.LEFT))
        _, _, err = end(program)
        # What rclpy.spin raises is ROS's way of ending, also where it interrupts the beacon. Before
        # it and after it the beacon has nothing to say.
        assert "beacon" not in err.partition("Traceback")[0]
        assert err.rstrip().rpartition("\n")[2].startswith(WAYS_TO_END)
        assert "Exception ignored" not in err
        assert "Exception in thread" not in err

    @pytest.mark.parametrize(
        "ending",
        [
            "",
            "raise SystemExit",
            "node.destroy_node(); rclpy.shutdown()",
            "rclpy.shutdown()",
            "del beacon, node",
        ],
    )
    def test_one_that_comes_to_its_end_says_goodbye_and_nothing_else(
        self,
        listener: Listener,
        start_script: Start,
        end: End,
        eventually: Eventually,
        ending: str,
    ) -> None:
        program = start_script(PROGRAM + SPEAKING + ending)
        eventually(lambda: listener.has("arm"))
        assert end(program) == (0, "", "")
        eventually(lambda: listener.has("arm", Status.LEFT))

    def test_a_forked_child_says_no_goodbye_for_its_parent_and_nothing_in_its_name(
        self,
        listener: Listener,
        start_script: Start,
        end: End,
        eventually: Eventually,
    ) -> None:
        program: Any = start_script(
            PROGRAM
            + "from beacon_core.errors import UsageError\n"
            + "import atexit\n"
            + SPEAKING
            + "pid = os.fork()\n"
            + "if not pid:\n"
            + "    try: beacon.update(display_name='child')\n"
            + "    except UsageError as error: print(error, flush=True)\n"
            + "    beacon.close()\n"
            + "    atexit._run_exitfuncs()\n"  # what is left of the end is ROS's, which crashes
            + "    os._exit(0)\n"
            + "assert os.waitpid(pid, 0)[1] == 0\n"
            + "sys.stdin.readline()\n"
        )
        eventually(lambda: listener.has("arm"))
        program.stdin.write("fork\n")
        program.stdin.flush()
        while program.stdout.readline() != f"update: made before a fork; {NO_FORK}\n":
            assert program.poll() is None
        assert end(program) == (0, "", "")
        eventually(lambda: listener.has("arm", Status.LEFT) and goodbyes(listener))
        assert goodbyes(listener) == 1
