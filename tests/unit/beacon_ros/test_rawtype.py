"""Types made at run time are announced as the generated ones are, and understood by them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is no type to compare with")

from rclpy.serialization import serialize_message
from unique_identifier_msgs.msg import UUID

from beacon_core.errors import ConfigError
from beacon_ros import rawtype
from beacon_ros.graph import publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type, raw_type

UUID_NAME = "unique_identifier_msgs/msg/UUID"
UUID_HASH = "RIHS01_1b8e8aca958cbea28fe6ef60bf6c19b683c97a9ef60bb34752067d0f2f7ab437"
MESSAGE = UUID(uuid=list(range(16)))

Eventually = Callable[..., None]


@pytest.fixture
def typed(domain: int) -> Iterator[OwnNode]:
    made = OwnNode("typed", domain)
    yield made
    made.close()


@pytest.fixture
def raw(domain: int) -> Iterator[OwnNode]:
    """In a context of its own: in one, a type's name stands for one type."""
    other = OwnNode("raw", None)
    yield other
    other.close()


@pytest.fixture(autouse=True)
def _environment(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))


def test_its_name_and_hash_are_announced_as_those_of_the_generated_type(
    typed: OwnNode, raw: OwnNode, eventually: Eventually
) -> None:
    typed.node.create_publisher(UUID, "/ids", 1)
    raw.node.create_publisher(raw_type(UUID_NAME, UUID_HASH), "/ids", 1)
    for own in (typed, raw):
        eventually(lambda own=own: len(publishers(own.node, "/ids")) == 2)
        told = {(one.type_name, one.type_hash) for one in publishers(own.node, "/ids")}
        assert told == {(UUID_NAME, UUID_HASH)}


def test_what_it_publishes_is_read_by_the_generated_type(
    typed: OwnNode, raw: OwnNode, eventually: Eventually
) -> None:
    subscription = typed.node.create_subscription(UUID, "/ids", print, 1)
    publisher = raw.node.create_publisher(raw_type(UUID_NAME, UUID_HASH), "/ids", 1)

    def taken() -> Any:
        publisher.publish(serialize_message(MESSAGE))
        with subscription.handle:
            return subscription.handle.take_message(UUID, False)

    eventually(taken)
    publisher.publish(serialize_message(MESSAGE))
    eventually(lambda: (found := taken()) and found[0] == MESSAGE)


def test_what_the_generated_type_publishes_is_read_by_it(
    typed: OwnNode, raw: OwnNode, eventually: Eventually
) -> None:
    made = raw_type(UUID_NAME, UUID_HASH)
    subscription = raw.node.create_subscription(made, "/ids", print, 1, raw=True)
    publisher = typed.node.create_publisher(UUID, "/ids", 1)

    def taken() -> Any:
        publisher.publish(MESSAGE)
        with subscription.handle:
            return subscription.handle.take_message(made, True)

    eventually(lambda: (found := taken()) and found[0] == serialize_message(MESSAGE))


def test_it_is_made_once() -> None:
    assert raw_type(UUID_NAME, UUID_HASH) is raw_type(UUID_NAME, UUID_HASH)


def test_of_an_installed_package_it_is_the_installed_class() -> None:
    assert message_type(UUID_NAME, UUID_HASH) is UUID


def test_an_installed_class_is_ready_for_use_in_a_program_that_did_nothing_else(
    run_script: Callable[[str], subprocess.CompletedProcess[str]],
) -> None:
    ended = run_script(
        "from beacon_ros.rawtype import message_type\n"
        f"made = message_type({UUID_NAME!r}, {UUID_HASH!r})\n"
        "print(type(made)._TYPE_SUPPORT is not None)"
    )
    assert (ended.stdout, ended.stderr) == ("True\n", "")


def test_without_the_package_it_is_made_here() -> None:
    made = message_type("beacon_no_msgs/msg/Part", UUID_HASH)
    assert (made.__module__, made.__name__) == ("beacon_no_msgs.msg", "Part")


@pytest.mark.parametrize("text", ["", "raise ImportError('libbroken.so')", "Part = object()"])
def test_so_it_is_with_a_package_that_is_too_old_or_broken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    package = tmp_path / "beacon_old_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("beacon_old_msgs", "beacon_old_msgs.msg"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    made = message_type("beacon_old_msgs/msg/Part", UUID_HASH)
    assert made is raw_type("beacon_old_msgs/msg/Part", UUID_HASH)


def test_where_it_cannot_be_made_either_it_is_said_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rawtype, "why_no_raw_types", lambda: "here is no ROS; install it")
    with pytest.raises(ConfigError) as refusal:
        message_type("beacon_no_msgs/msg/Part", UUID_HASH)
    assert str(refusal.value) == (
        "beacon_no_msgs/msg/Part cannot be imported (No module named 'beacon_no_msgs'), "
        "and here is no ROS; install it"
    )
