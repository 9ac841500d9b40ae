"""A child that announces what it is told, and is missed soon after it was killed."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition, Health
from beacon_core.wire import json as wire
from beacon_ros import mortal
from beacon_ros.mortal import LEASE_S, MortalAnnouncer, short_lease


class Said:
    """An announcer that writes down what it is told."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def announce(self, hint: BeaconHint) -> None:
        self.words.append(f"announce {hint.entity_id}")

    def withdraw(self, entity_id: str) -> None:
        self.words.append(f"withdraw {entity_id}")

    def close(self) -> None:
        self.words.append("close")

    def health(self) -> Health:
        return Health(Condition.UP)


ORDERS = [
    json.dumps(["announce", wire.encode(BeaconHint("engine")).decode()]),
    json.dumps(["withdraw", "engine"]),
]

# An adapter in a file, whose announcer writes down what it is told.
ADAPTER = """
import attrs
from pathlib import Path
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.health import Condition, Health
from beacon_core.wire import json

@attrs.frozen
class Options:
    file: str

class Notes:
    def __init__(self, options, period_s):
        self.file = Path(options.file)
        self.note(f"period {period_s}")
    def note(self, what):
        with self.file.open("a") as file:
            file.write(what + "\\n")
    def announce(self, hint): self.note("announce " + hint.entity_id)
    def withdraw(self, entity_id): self.note("withdraw " + entity_id)
    def close(self): self.note("close")
    def health(self): return Health(Condition.UP)

ADAPTER = Adapter("notes", Options, json.decode, None, Notes)
"""


@attrs.frozen
class Options:
    file: str


@pytest.fixture
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "beacon_notes.py").write_text(ADAPTER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return tmp_path / "notes"


def test_a_child_obeys_and_vanishes_at_the_end_of_its_orders() -> None:
    announcer = Said()
    mortal._obey(announcer, ORDERS)
    assert announcer.words == ["announce engine", "withdraw engine"]


def test_an_interrupted_child_says_goodbye() -> None:
    def orders() -> Iterator[str]:
        yield ORDERS[0]
        raise KeyboardInterrupt

    announcer = Said()
    mortal._obey(announcer, orders())
    assert announcer.words == ["announce engine", "close"]


def test_a_child_makes_the_announcer_of_any_adapter_and_closes_it(notes: Path) -> None:
    announcer = MortalAnnouncer("beacon_notes", Options(str(notes)), 2.5)
    announcer.announce(BeaconHint("engine"))
    announcer.withdraw("engine")
    wait_for(notes, "withdraw engine")
    assert announcer.health().condition is Condition.UP
    announcer.close()
    assert announcer.health().condition is Condition.CLOSED
    said = notes.read_text().splitlines()
    assert said == ["period 2.5", "announce engine", "withdraw engine", "close"]


def test_a_child_that_is_killed_says_nothing(notes: Path) -> None:
    announcer = MortalAnnouncer("beacon_notes", Options(str(notes)))
    wait_for(notes, "period None")
    assert announcer.end(signal.SIGKILL) == -signal.SIGKILL
    assert notes.read_text() == "period None\n"


def test_a_child_whose_parent_has_gone_ends_and_says_nothing(notes: Path) -> None:
    announcer = MortalAnnouncer("beacon_notes", Options(str(notes)))
    wait_for(notes, "period None")
    assert announcer.process.stdin is not None
    announcer.process.stdin.close()
    assert announcer.process.wait(30) == 0
    assert notes.read_text() == "period None\n"


def test_the_profile_is_there_and_says_what_the_constant_says() -> None:
    (profile,) = set(short_lease().values())
    (lease,) = ET.parse(profile).iterfind(".//{*}leaseDuration")  # noqa: S314 - our own file
    assert float(lease[0].text or "") == LEASE_S


def wait_for(notes: Path, line: str) -> None:
    deadline = time.monotonic() + 30  # a process starts
    while not (notes.exists() and line in notes.read_text().splitlines()):
        assert time.monotonic() < deadline, f"never said: {line}"
        time.sleep(0.01)
