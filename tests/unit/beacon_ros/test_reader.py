"""A reader takes a topic's messages and tells of its publishers, with nobody to spin it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no topics")

from rclpy.exceptions import InvalidHandle
from rclpy.qos import QoSProfile, ReliabilityPolicy
from unique_identifier_msgs.msg import UUID

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_ros.graph import publishers
from beacon_ros.participant import OwnNode
from beacon_ros.rawtype import message_type
from beacon_ros.reader import Reader

Eventually = Callable[..., None]

DEEP = QoSProfile(depth=2000)
HEADER = b"\0\1\0\0"


class Owner:
    """Writes down what the reader calls."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.messages: list[tuple[bytes, bytes, int, int]] = []
        self.publishers: list[int] = []
        self.misfits: list[int] = []
        self.ends: list[str] = []
        self.doing: Callable[[], object] = lambda: None

    def on_message(self, payload: bytes, gid: bytes, sequence: int, stamp_ns: int) -> None:
        self.messages.append((payload, gid, sequence, stamp_ns))
        self.calls.append("message")
        self.doing()

    def on_matched(self, publishers: int) -> None:
        self.publishers.append(publishers)

    def on_incompatible(self, total: int) -> None:
        self.misfits.append(total)

    def step(self) -> float | None:
        self.calls.append("step")
        return None

    def on_end(self, error: str) -> None:
        self.ends.append(error)


@pytest.fixture
def own(domain: int) -> Iterator[OwnNode]:
    made = OwnNode("reader", domain)
    yield made
    made.close()


@pytest.fixture
def owner() -> Owner:
    return Owner()


@pytest.fixture
def reader(own: OwnNode, owner: Owner) -> Iterator[Reader]:
    made = Reader(own.node, message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP, owner)
    yield made
    made.close(5.0)


def test_a_message_comes_with_its_publisher(
    own: OwnNode, owner: Owner, reader: Reader, eventually: Eventually
) -> None:
    reader.start()
    publisher = own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP)
    publisher.publish(HEADER + b"abcd")
    eventually(lambda: owner.messages)
    ((payload, gid, sequence, stamp_ns),) = owner.messages
    assert (payload, sequence) == (HEADER + b"abcd", 1)
    assert stamp_ns > 1_700_000_000 * 10**9
    assert [one.gid for one in publishers(own.node, "/topic")] == [gid]


def test_an_installed_type_is_read_as_well(
    own: OwnNode, owner: Owner, eventually: Eventually
) -> None:
    reader = Reader(own.node, UUID, "/ids", DEEP, owner)
    reader.start()
    own.node.create_publisher(UUID, "/ids", DEEP).publish(UUID(uuid=list(range(16))))
    eventually(lambda: owner.messages)
    assert owner.messages[0][0] == HEADER + bytes(range(16))
    assert reader.close(5.0)


def test_publishers_that_come_and_go_are_told_of(
    own: OwnNode, owner: Owner, reader: Reader, eventually: Eventually
) -> None:
    reader.start()
    made = message_type(TYPE_NAME, TYPE_HASH)
    publisher = own.node.create_publisher(made, "/topic", DEEP)
    eventually(lambda: owner.publishers == [1])
    own.node.destroy_publisher(publisher)
    eventually(lambda: owner.publishers == [1, 0])


def test_publishers_that_do_not_fit_are_told_of(
    own: OwnNode, owner: Owner, reader: Reader, eventually: Eventually
) -> None:
    reader.start()
    lossy = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    for total in (1, 2):
        own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", lossy)
        eventually(lambda total=total: owner.misfits[-1:] == [total])
    assert owner.publishers == []


def test_many_messages_leave_the_owner_its_turn(
    own: OwnNode, owner: Owner, reader: Reader, eventually: Eventually
) -> None:
    publisher = own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP)
    for _ in range(1000):
        publisher.publish(HEADER)
    reader.start()
    eventually(lambda: len(owner.messages) == 1000)
    batches = " ".join(owner.calls).split("step")
    assert max(batch.count("message") for batch in batches) == 256
    assert [number for _, _, number, _ in owner.messages] == list(range(1, 1001))


def test_closed_by_a_message_it_takes_no_more(
    own: OwnNode, owner: Owner, reader: Reader, eventually: Eventually
) -> None:
    publisher = own.node.create_publisher(message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP)
    for _ in range(100):
        publisher.publish(HEADER)
    owner.doing = lambda: reader.close(1.0)
    reader.start()
    eventually(lambda: owner.ends == [""])
    assert len(owner.messages) == 1


def test_fifty_readers_leave_nothing(
    own: OwnNode, owner: Owner, leaves_nothing: Callable[..., None]
) -> None:
    def come_and_go() -> None:
        reader = Reader(own.node, message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP, owner)
        reader.start()
        assert reader.close(5.0)

    leaves_nothing(come_and_go)
    assert owner.ends == [""] * 51


def test_a_node_that_is_no_more_is_refused(domain: int, owner: Owner) -> None:
    own = OwnNode("reader", domain)
    own.close()
    with pytest.raises(InvalidHandle):
        Reader(own.node, message_type(TYPE_NAME, TYPE_HASH), "/topic", DEEP, owner)
