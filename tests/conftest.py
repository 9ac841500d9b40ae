"""For all tests: how many run at once, and that who they start can be interrupted."""

from __future__ import annotations

import os
import signal

import pytest


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Twice as many as there are cores: tests wait more than they compute. There are a hundred ROS
    domains, of which one may take three."""
    return min(2 * (os.cpu_count() or 1), 32)


def pytest_configure() -> None:
    # What a shell runs in the background ignores Ctrl-C, and so would every process of a test.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
