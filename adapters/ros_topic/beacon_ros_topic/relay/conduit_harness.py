"""A conduit over ROS topics as the suite for conduits wants it, in a ROS domain of its own."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from beacon_core.testing.relay.conduit_harness import ConduitCapabilities, RealTimeConduitHarness
from beacon_ros.domains import DomainLease
from beacon_ros_topic.relay.conduit import RosConduit
from beacon_ros_topic.relay.options import RosConduitOptions

__all__ = ["RosConduitHarness"]

_OTHER = """
import sys, time
from beacon_core.testing.relay.conduit_harness import End
from beacon_ros_topic.relay.conduit import RosConduit
from beacon_ros_topic.relay.options import RosConduitOptions
end = End(RosConduit(RosConduitOptions(domain_id=int(sys.argv[1])))).start()
while not end.sink.up:
    time.sleep(0.01)
print("linked", flush=True)
sys.stdin.readline()
end.conduit.close()
"""


class RosConduitHarness(RealTimeConduitHarness):
    """A :class:`beacon_core.testing.relay.harness.ConduitHarness`.

    Ends of one process cannot be cut off from each other without rights that tests do not have.
    """

    capabilities = ConduitCapabilities(breaks=False, freezes=True)
    patience_s = 20.0
    waiting_bytes = 100 * 256 * 1024
    """The depth, times the size of the suite's messages."""

    def __init__(self) -> None:
        self._lease = DomainLease()
        self._made: list[RosConduit] = []
        self._others: list[subprocess.Popen[bytes]] = []

    def conduit(self) -> RosConduit:
        made = RosConduit(RosConduitOptions(domain_id=self._lease.domain_id))
        self._made.append(made)
        return made

    @contextmanager
    def frozen(self) -> Iterator[None]:
        process = subprocess.Popen(  # noqa: S603 - our own module
            [sys.executable, "-c", _OTHER, str(self._lease.domain_id)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._others.append(process)
        assert process.stdout is not None  # noqa: S101 - for the type checker
        process.stdout.readline()
        # Those here may not be yet, and would never be: what is not up refuses a frame.
        self.wait_until(
            lambda: all(one.send(b"linked?", b"") for one in self._made), self.patience_s
        )
        process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            process.send_signal(signal.SIGCONT)

    def close(self) -> None:
        for made in self._made:
            made.close()
        for process in self._others:
            process.communicate(b"\n", 10)
        self._lease.close()
