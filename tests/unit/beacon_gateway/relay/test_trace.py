"""What the cores were told is kept, and comes again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from beacon_core.errors import ConfigError
from beacon_core.relay.effects import Arm, Send, Subscribe
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.settings import Forwarding, Republishing
from beacon_core.relay.values import Mode, Qos, TopicType
from beacon_gateway.relay.births import ForwarderBirth, RepublisherBirth
from beacon_gateway.relay.trace import TraceFile, replay

RULES = NameMap((Rule(allow=True, pattern="/**", to="/r/**", mode=Mode.LATEST),))
FORWARDER = ForwarderBirth(7, 2, RULES, Forwarding(hold_bytes=1000), 5)
REPUBLISHER = RepublisherBirth(9, (7, 8), Republishing(advertise_delay_ns=None), 5)
SEEN = SeenTopic(TopicType("a/msg/B", "RIHS01_1"), Qos(depth=3), b"int32 \xff")


def recorded(path: Path, *, lie: bool = False) -> None:
    """A forwarder's first calls."""
    core = FORWARDER.make()
    with TraceFile(path) as file:
        trace = file.of("robot", (FORWARDER, REPUBLISHER))
        calls = (("link_up", ()), ("topic_seen", ("/a", SEEN)), ("message", (1, b"\0\xff")))
        for now_ns, (method, args) in enumerate(calls, 10):
            named = {"stamp_ns": 3} if method == "message" else {}
            effects = getattr(core, method)(*args, now_ns, **named)
            trace.write(0, method, args, named, now_ns, [] if lie else effects)


def test_a_trace_is_replayed_with_all_that_was_told_and_answered(tmp_path: Path) -> None:
    recorded(tmp_path / "t")
    up, seen, message = replay(tmp_path / "t")
    assert (up.end, up.core, up.method, up.at_ns, up.line) == (
        "robot",
        "forwarder",
        "link_up",
        10,
        3,
    )
    assert {type(one) for one in up.effects} == {Send, Arm}
    assert seen.args == ("/a", SEEN)
    assert {type(one) for one in seen.effects} == {Send, Subscribe}
    assert (message.args, message.named) == ((1, b"\0\xff"), {"stamp_ns": 3})
    assert up.alike
    assert seen.alike
    assert message.alike


def test_an_answer_that_is_not_as_it_was_is_told(tmp_path: Path) -> None:
    recorded(tmp_path / "t", lie=True)
    assert not any(step.alike for step in replay(tmp_path / "t"))


def test_after_the_end_nothing_is_written(tmp_path: Path) -> None:
    with TraceFile(tmp_path / "t") as file:
        trace = file.of("robot", (None, REPUBLISHER))
    trace.write(1, "tick", (), {}, 10, [])
    assert len((tmp_path / "t").read_text().splitlines()) == 1


@pytest.mark.parametrize(
    "spoil",
    [
        lambda lines: ["no JSON"],
        lambda lines: [lines[0][:40]],
        lambda lines: lines[2:],
        lambda lines: [lines[0], lines[2].replace("link_up", "__init__")],
        lambda lines: [lines[0].replace('"origin":7', '"origin":"x"'), *lines[1:]],
        lambda lines: [json.dumps({"end": "robot"})],
    ],
)
def test_what_is_no_trace_is_refused(tmp_path: Path, spoil: object) -> None:
    path = tmp_path / "t"
    recorded(path)
    assert callable(spoil)
    path.write_text("\n".join(spoil(path.read_text().splitlines())))
    with pytest.raises(ConfigError, match="not a relay's trace, or cut short"):
        list(replay(path))


def test_a_file_that_cannot_be_had_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nowhere"):
        list(replay(tmp_path / "nowhere"))
    with pytest.raises(ConfigError, match="nowhere/t"):
        TraceFile(tmp_path / "nowhere" / "t")
