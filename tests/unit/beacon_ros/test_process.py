"""What a hint does not say of its process is filled in."""

from __future__ import annotations

import os
import socket
import sys

import pytest

from beacon_core.hint import BeaconHint
from beacon_ros.process import identified


def test_what_is_not_given_is_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["/opt/robot/bin/arm_driver", "--fast"])
    hint = identified(BeaconHint("arm", display_name="Arm"))
    assert hint == BeaconHint(
        "arm",
        display_name="Arm",
        process_id=os.getpid(),
        process_name="arm_driver",
        hostname=socket.gethostname(),
    )


def test_what_is_given_is_kept() -> None:
    hint = BeaconHint("arm", process_id=7, process_name="firmware", hostname="arm-controller")
    assert identified(hint) == hint


def test_a_program_without_arguments_has_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [])
    assert identified(BeaconHint("arm")).process_name == ""
