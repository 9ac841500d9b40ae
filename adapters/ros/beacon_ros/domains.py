"""A ROS domain that nobody else on this machine has: for tests and benches, also side by side.

Two processes on one domain hear each other. So whoever wants to be alone takes a domain here, and
every other taker, in this process or another, gets a different one.

A domain is held by a socket bound to an abstract name. Such a name belongs to the network
namespace, as the domain's ports do, and the kernel gives it back when the process ends, however it
ends.
"""

from __future__ import annotations

import os
import random
import socket
from pathlib import Path
from types import TracebackType
from typing import Self

__all__ = ["DOMAINS", "DomainLease"]

DOMAINS = range(1, 101)
"""0 is everybody's default. Above 101 the ports of DDS (7400 + 250 x domain) reach into those that
the system gives to anyone (from 32768)."""

_STAY_HERE = {
    # Not LOCALHOST: rmw_fastrtps would add shared memory, whatever else is said.
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(Path(__file__).with_name("loopback.xml")),
}


class DomainLease:
    """Holds ``domain_id`` until ``close`` or the end of the process; also a context manager.

    Others on the network know nothing of it. So from the first lease on, all ROS contexts that this
    process makes, and those of its children, stay on this machine; and they use no shared memory,
    which Fast DDS shares between all domains: a process that was killed leaves it locked, and then
    others, of any domain, may not hear each other or hang.
    """

    domain_id: int

    def __init__(self) -> None:
        """Raises ``RuntimeError`` if all domains are taken."""
        os.environ.update(_STAY_HERE)
        self._held = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        # At random: whoever was here before may not have left the network altogether.
        for domain_id in random.sample(DOMAINS, len(DOMAINS)):
            try:
                self._held.bind(f"\0beacon-ros-domain-{domain_id}")
            except OSError:
                continue
            self.domain_id = domain_id
            return
        self._held.close()
        raise RuntimeError(f"all of the ROS domains {DOMAINS[0]} to {DOMAINS[-1]} are in use")

    def close(self) -> None:
        """Give it back. Idempotent."""
        self._held.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
