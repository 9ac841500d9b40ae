"""For all tests: ROS processes of different tests share nothing."""

from __future__ import annotations

import os

# Fast DDS numbers its shared-memory ports from 7000 on for the whole machine, whatever the domain,
# and a process that is killed leaves its own locked. Tests kill processes, and run side by side:
# now and then two that are alive and on one domain could not hear each other (3 runs of 10).
# By UDP each domain has ports of its own, which the kernel takes back.
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
