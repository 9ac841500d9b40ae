"""The announcer's own promises; that what it says arrives is in the contract suite."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to announce to")

from rclpy.qos import DurabilityPolicy, QoSProfile
from unique_identifier_msgs.msg import UUID

from beacon_core.errors import ConfigError, UsageError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Status
from beacon_core.ports.health import Condition
from beacon_core.testing.harness import CLOSE_WITHIN_S, Listener, within
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME, farewell
from beacon_ros.graph import publishers
from beacon_ros.participant import NO_FORK, OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.taking import Taken, taker
from beacon_ros_topic import RosTopicOptions
from beacon_ros_topic.announcer import RosTopicAnnouncer, _Voice
from beacon_ros_topic.harness import RosTopicHarness

pytestmark = pytest.mark.system

Eventually = Callable[..., None]

TOPIC = RosTopicOptions().topic
ENGINE = BeaconHint("engine")
PAYLOAD = cdr.encode(ENGINE)


class Ear:
    """A subscriber in another context: what anybody's would hear."""

    def __init__(self) -> None:
        self.own = OwnNode("ear", None)
        self.node = self.own.node
        subscription = self.node.create_subscription(
            message_type(TYPE_NAME, TYPE_HASH), TOPIC, print, QoSProfile(depth=5000), raw=True
        )
        self._take: Callable[[], Taken | None] = taker(subscription.handle)
        self._heard: list[bytes] = []

    def heard(self) -> list[bytes]:
        while taken := self._take():
            self._heard.append(taken[0])
        return self._heard

    def forget(self) -> None:
        self._heard.clear()


def met(made: RosTopicAnnouncer, ear: Ear, eventually: Eventually) -> None:
    """Both ends know each other, and what was said in order to find out is over."""

    def heard() -> list[bytes]:
        made.announce(BeaconHint("hello"))
        return ear.heard()

    eventually(heard)
    eventually(lambda: made.health().counters["listeners"])
    made.withdraw("hello")
    eventually(lambda: ear.heard()[-1] == farewell("hello"))
    ear.forget()


@pytest.fixture
def ear(harness: RosTopicHarness) -> Iterator[Ear]:
    made = Ear()
    yield made
    made.own.close()


@pytest.fixture
def hung(
    harness: RosTopicHarness, start_script: Callable[[str], subprocess.Popen[str]]
) -> Callable[[], None]:
    """Starts a gateway, and stops it when it has heard something."""

    def start() -> None:
        gateway = start_script(GATEWAY)
        assert gateway.stdout is not None
        while gateway.stdout.readline() not in ("heard\n", ""):
            pass
        os.kill(gateway.pid, signal.SIGSTOP)

    return start


GATEWAY = """
import sys
from beacon_core.outcome import Outcome, Verdict
from beacon_ros_topic import RosTopicOptions
from beacon_ros_topic.source import RosTopicSource

class Sink:
    def offer(self, *_, **__):
        print("heard", flush=True)
        return Outcome(Verdict.NEW, "x")
    goodbye = lost = offer

source = RosTopicSource(RosTopicOptions())
source.start(Sink())
sys.stdin.readline()
"""


def announcer(period_s: float | None = 3600.0, **options: Any) -> RosTopicAnnouncer:
    return RosTopicAnnouncer(RosTopicOptions(**options), period_s)


def test_what_it_says_is_the_message_and_at_last_the_goodbye(
    ear: Ear, eventually: Eventually
) -> None:
    made = announcer()
    met(made, ear, eventually)
    made.announce(ENGINE)
    made.withdraw("engine")
    made.withdraw("engine")
    made.withdraw("nobody")
    eventually(lambda: len(ear.heard()) >= 2)
    made.close()
    assert ear.heard() == [PAYLOAD, farewell("engine")]


def test_a_late_listener_is_told_at_once_whatever_the_period_and_the_qos(
    harness: RosTopicHarness, eventually: Eventually
) -> None:
    made = announcer(3600.0)
    for number in range(50):
        made.announce(BeaconHint(f"part-{number}"))
    listener = Listener(harness).start()
    assert harness.options().durability == "volatile"
    eventually(lambda: all(listener.has(f"part-{number}") for number in range(50)))
    made.close()


def test_a_late_listener_is_told_at_the_pace_that_a_gateway_hears_one_publisher(
    harness: RosTopicHarness, eventually: Eventually
) -> None:
    made = announcer(3600.0)
    for number in range(250):
        made.announce(BeaconHint(f"part-{number}"))
    listener = Listener(harness, source_rate=100.0).start()
    eventually(lambda: all(listener.has(f"part-{number}") for number in range(250)))
    made.close()


def test_hints_are_repeated_in_the_same_bytes_without_a_stamp(
    ear: Ear, eventually: Eventually
) -> None:
    made = announcer(0.01)
    made.announce(ENGINE)
    eventually(lambda: len(ear.heard()) >= 10)
    made.close()
    eventually(lambda: ear.heard()[-1] == farewell("engine"))
    assert set(ear.heard()[:-1]) == {PAYLOAD}


def test_without_a_period_it_speaks_when_told(ear: Ear, eventually: Eventually) -> None:
    made = announcer(None)
    met(made, ear, eventually)
    said = [BeaconHint("engine", display_name=f"{number}") for number in range(3)]
    for hint in said:
        made.announce(hint)
    eventually(lambda: ear.heard() == [*map(cdr.encode, said)])
    made.close()


def test_repetitions_come_early_by_chance_and_never_late(harness: RosTopicHarness) -> None:
    made = announcer(10.0)
    waits = []
    for number in range(200):
        voice = made._voices[f"part-{number}"] = _Voice(b"")
        before_ns = time.monotonic_ns()
        made._schedule_next(f"part-{number}", voice)
        waits.append((voice.due_ns - before_ns) / 1e9)
    assert 8.5 <= min(waits) < 8.8
    assert 9.7 < max(waits) <= 10.01
    made._voices.clear()
    made.close()


def test_who_speaks_much_oftener_than_its_period_leaves_nothing_behind(
    harness: RosTopicHarness,
) -> None:
    made = announcer(3600.0)
    for number in range(1000):
        made.announce(BeaconHint(f"part-{number % 3}", display_name=f"{number}"))
    assert len(made._beats) <= 113
    assert {name for _, name, _ in made._beats} == {"part-0", "part-1", "part-2"}
    made.close()


def test_listeners_that_come_and_go_leave_nothing_behind(harness: RosTopicHarness) -> None:
    made = announcer(None)
    for number in range(30):
        made.announce(BeaconHint(f"part-{number}"))
    for _ in range(200):
        made._tell_newcomer()
    assert len(made._beats) <= 4 * 30 + 100 + 3 * 30
    made.close()


def test_one_withdrawn_is_not_repeated(ear: Ear, eventually: Eventually) -> None:
    made = announcer(0.02)
    for entity_id in ("engine", "brake"):
        made.announce(BeaconHint(entity_id))
    eventually(ear.heard)
    made.withdraw("engine")
    eventually(lambda: farewell("engine") in ear.heard())
    after = len(ear.heard())
    eventually(lambda: len(ear.heard()) >= after + 5)
    assert PAYLOAD not in ear.heard()[after:]
    made.close()


def test_one_announced_anew_is_repeated_as_it_is_now(ear: Ear, eventually: Eventually) -> None:
    made = announcer(0.02)
    made.announce(ENGINE)
    made.withdraw("engine")
    now = BeaconHint("engine", display_name="now")
    made.announce(now)
    eventually(lambda: ear.heard()[-3:] == [cdr.encode(now)] * 3)
    made.close()


def test_its_health_says_whether_anybody_listens(
    harness: RosTopicHarness, eventually: Eventually
) -> None:
    made = announcer()
    made.announce(ENGINE)
    health = made.health()
    assert health.condition is Condition.STARTING
    assert health.detail == (
        f"nobody listens on {TOPIC}; is the gateway in the same ROS domain? Ask: beacon doctor"
    )
    ears = [Ear(), Ear()]
    eventually(lambda: made.health().counters == {"entities": 1, "listeners": 2})
    assert made.health().condition is Condition.UP
    for ear in ears:
        ear.own.close()
    eventually(lambda: made.health().condition is Condition.DOWN)
    assert made.health().detail.startswith("nobody listens")
    made.close()
    assert made.health().condition is Condition.CLOSED


@pytest.mark.parametrize("period_s", [0, -1.0, float("nan"), float("inf")])
def test_a_period_that_is_none_is_refused(period_s: float) -> None:
    with pytest.raises(ConfigError, match=r"^period_s: .* write seconds above 0"):
        announcer(period_s)


def test_an_id_that_is_none_is_refused(harness: RosTopicHarness) -> None:
    made = announcer()
    with pytest.raises(UsageError, match=r"^announce: entity_id '../x' is no id"):
        made.announce(BeaconHint("../x"))
    made.close()


def test_after_close_nothing_is_announced(harness: RosTopicHarness) -> None:
    made = announcer()
    made.announce(ENGINE)
    made.close()
    made.close()
    made.withdraw("engine")
    with pytest.raises(UsageError, match="closed; make a new one"):
        made.announce(ENGINE)
    assert made.health().counters["entities"] == 0


def test_it_offers_what_its_options_say(harness: RosTopicHarness, ear: Ear) -> None:
    made = announcer(durability="transient_local", reliability="best_effort", depth=1)
    (found,) = publishers(made._own.node, TOPIC)
    assert (found.durability, found.reliability) == ("transient_local", "best_effort")
    assert made._publisher.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
    made.close()


def test_refused_by_ros_it_leaves_nothing(ear: Ear, leaves_nothing: Callable[..., None]) -> None:
    ear.node.create_publisher(UUID, "/ids", 1)  # in the context that the announcer shares

    def refused() -> None:
        with pytest.raises(ConfigError, match=r"^topic: ROS refuses '/ids'.*another type"):
            announcer(topic="/ids")

    leaves_nothing(refused, 5)
    assert len(ear.node.get_node_names()) == 1


class TestEndings:
    def test_a_listener_that_hangs_holds_nobody_up_for_more_than_a_second(
        self, hung: Callable[[], None], eventually: Eventually
    ) -> None:
        made = announcer(None)
        for number in range(3000):
            made.announce(BeaconHint(f"part-{number}"))
        hung()
        for number in range(3000):
            made.announce(BeaconHint(f"part-{number}", display_name="more"))
        within(CLOSE_WITHIN_S, made.close)

    def test_when_its_context_is_shut_down_it_says_goodbye_and_its_health_says_why(
        self, harness: RosTopicHarness, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        made = announcer(3600.0)
        made.announce(ENGINE)
        eventually(lambda: listener.has("engine"))
        made._own.context.shutdown()
        eventually(lambda: listener.has("engine", Status.LEFT))
        assert made.health().condition is Condition.DOWN
        assert made.health().detail == "the ROS context was shut down; make a new announcer"
        made.announce(ENGINE)
        made.withdraw("engine")
        made.close()
        assert made.health().condition is Condition.CLOSED
        assert listener.has("engine", Status.LEFT)

    def test_so_it_does_when_ros_shut_it_down_without_a_word(
        self, harness: RosTopicHarness, eventually: Eventually
    ) -> None:
        listener = Listener(harness).start()
        made = announcer(3600.0)
        made.announce(ENGINE)
        eventually(lambda: listener.has("engine"))
        handle = made._own.context.handle
        assert handle is not None
        with handle:
            handle.shutdown()  # as ROS's signal handler does
        made.announce(ENGINE)
        eventually(lambda: listener.has("engine", Status.LEFT))
        eventually(lambda: made.health().condition is Condition.DOWN)
        made.close()

    def test_what_else_keeps_it_from_speaking_is_raised(
        self, harness: RosTopicHarness, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def publish(message: object) -> None:
            raise OSError("no more memory")

        made = announcer()
        monkeypatch.setattr(made._publisher, "publish", publish)
        with pytest.raises(OSError, match="no more memory"):
            made.announce(ENGINE)
        made.close()

    def test_a_defect_in_its_thread_is_no_goodbye(
        self, harness: RosTopicHarness, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
    ) -> None:
        def publish(message: object) -> None:
            raise OSError("no more memory")

        listener = Listener(harness).start()
        made = announcer(0.2)
        made.announce(ENGINE)
        eventually(lambda: listener.has("engine"))
        monkeypatch.setattr(made._publisher, "publish", publish)
        eventually(lambda: listener.has("engine", Status.STALE))
        assert made.health().detail == "reading ended: no more memory; make a new announcer"
        made.close()

    def test_a_program_that_ends_without_closing_it_has_said_goodbye(
        self,
        harness: RosTopicHarness,
        start_script: Callable[[str], subprocess.Popen[str]],
        end: Callable[[object], tuple[int, str, str]],
        eventually: Eventually,
    ) -> None:
        listener = Listener(harness).start()
        program = start_script(
            "import sys\n"
            "from beacon_core.hint import BeaconHint\n"
            "from beacon_ros_topic import RosTopicOptions\n"
            "from beacon_ros_topic.announcer import RosTopicAnnouncer\n"
            "announcer = RosTopicAnnouncer(RosTopicOptions(), 3600.0)\n"
            "announcer.announce(BeaconHint('engine'))\n"
            "sys.stdin.readline()\n"
        )
        eventually(lambda: listener.has("engine"))
        assert end(program) == (0, "", "")
        eventually(lambda: listener.has("engine", Status.LEFT))

    def test_in_a_forked_child_it_is_silent_and_goes_on_in_the_parent(
        self,
        harness: RosTopicHarness,
        start_script: Callable[[str], subprocess.Popen[str]],
        end: Callable[[object], tuple[int, str, str]],
        eventually: Eventually,
    ) -> None:
        listener = Listener(harness).start()
        program = start_script(
            "import os, sys, threading\n"
            "from beacon_core.errors import UsageError\n"
            "from beacon_core.hint import BeaconHint\n"
            "from beacon_ros_topic import RosTopicOptions\n"
            "from beacon_ros_topic.announcer import RosTopicAnnouncer\n"
            "announcer = RosTopicAnnouncer(RosTopicOptions(), 3600.0)\n"
            "announcer.announce(BeaconHint('engine'))\n"
            "sys.stdin.readline()\n"
            "held, enough = threading.Event(), threading.Event()\n"
            "def beat():\n"
            "    with announcer._lock: held.set(); enough.wait()\n"
            "threading.Thread(target=beat).start()\n"
            "held.wait()\n"
            "pid = os.fork()\n"
            "if not pid:\n"
            "    try: announcer.announce(BeaconHint('child'))\n"
            "    except UsageError as error: print(error, flush=True)\n"
            "    announcer.withdraw('engine'); announcer.close(); announcer.health()\n"
            "    os._exit(0)\n"
            "enough.set()\n"
            "assert os.waitpid(pid, 0)[1] == 0\n"
            "sys.stdin.readline()\n"
            "announcer.close()\n"
        )
        assert program.stdin is not None
        assert program.stdout is not None
        eventually(lambda: listener.has("engine"))
        program.stdin.write("fork\n")
        program.stdin.flush()
        said = f"announce: made before a fork; {NO_FORK}\n"
        while program.stdout.readline() != said:
            assert program.poll() is None
        assert listener.has("engine")
        assert end(program) == (0, "", "")
        eventually(lambda: listener.has("engine", Status.LEFT))
        assert {call.kind for call in listener.tap.calls[:-1]} == {"offer"}
