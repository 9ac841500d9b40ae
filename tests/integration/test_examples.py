"""The examples run as they are, in a process of their own."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(name: str, *arguments: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-W", "error", EXAMPLES / name, *arguments],
        capture_output=True,
        check=True,
        encoding="utf-8",
        timeout=60,
    )
    return done.stdout.splitlines()


def below(lines: list[str], heading: str) -> list[str]:
    """The indented lines under a heading."""
    found: list[str] = []
    for line in lines[lines.index(heading) + 1 :]:
        if not line.startswith("  "):
            break
        found.append(line.strip())
    return found


def test_a_gateway_embeds_the_core() -> None:
    lines = run("embed_in_your_gateway.py")
    assert [line.split()[0] for line in below(lines, "heard")] == [
        "new",
        "new",
        "new",
        "invalid",
        "malformed",
    ]
    assert below(lines, "added to the tree") == [
        "app        Engine temperature, hosted by ecu_front",
        "component  Front ECU",
        "function   Thermal management, joined by engine_temp",
        "skipped    toaster",
    ]
    metadata = dict(line.split(": ", 1) for line in below(lines, "metadata"))
    assert metadata.keys() == {"engine_temp", "ecu_front"}
    assert json.loads(metadata["ecu_front"])["x-medkit-beacon-hostname"] == "robot-7"
    assert json.loads(metadata["engine_temp"])["x-medkit-beacon-functions"] == ["thermal"]
    (response,) = below(lines, "vendor endpoint of engine_temp")
    assert len(json.loads(response)) == 14
    assert json.loads(response)["status"] == "active"


def test_an_application_mounts_the_interface() -> None:
    assert run("mount_in_your_app.py", "--once") == [
        "your own page",
        "/robots/api/v1/apps/engine_temp is active",
    ]
