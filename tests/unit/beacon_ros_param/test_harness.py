"""The harness's own parts: who falls silent, and what is not to be had."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no ROS to harness")

from beacon_core.hint import BeaconHint
from beacon_core.testing.harness import Harness, Listener
from beacon_ros.mortal import MortalAnnouncer
from beacon_ros_param.harness import RosParamHarness


@pytest.fixture
def harness() -> Iterator[RosParamHarness]:
    made = RosParamHarness()
    yield made
    made.close()


def test_each_network_is_a_domain_of_its_own(harness: RosParamHarness) -> None:
    options = [harness.options(network) for network in (0, 1, 0)]
    assert options[0] == options[2]
    assert options[0].domain_id != options[1].domain_id


@pytest.mark.parametrize("mortal", [False, True])
def test_who_is_silenced_does_not_answer_and_afterwards_does(
    harness: RosParamHarness, wait_for: Callable[..., None], *, mortal: bool
) -> None:
    whole: Harness = harness
    announcer, listener = whole.announcer(mortal=mortal), Listener(whole).start()
    announcer.announce(BeaconHint("engine"))
    wait_for(lambda: listener.has("engine"), "it is heard")

    def offers() -> int:
        return [call.kind for call in listener.tap.calls].count("offer")

    def is_silent() -> bool:
        heard = offers()
        return not harness.wait_until(lambda: offers() > heard, harness.quiet_s)

    with whole.silenced(announcer):
        harness.wait_until(lambda: False, 0.1)  # an answer may be on its way
        # On a busy machine for longer than that.
        assert is_silent() or is_silent()
        heard = offers()
    wait_for(lambda: offers() > heard, "it is heard again")


def test_a_silenced_announcer_may_be_crashed(harness: RosParamHarness) -> None:
    announcer = harness.announcer(mortal=True)
    assert isinstance(announcer, MortalAnnouncer)
    with harness.silenced(announcer):
        harness.crash(announcer)
    assert announcer.process.returncode == -signal.SIGKILL


def test_there_are_no_bytes_to_send(harness: RosParamHarness) -> None:
    with pytest.raises(NotImplementedError):
        harness.send_raw("engine", b"")
