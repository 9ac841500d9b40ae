from __future__ import annotations

from beacon_fake.conduit import FakeConduit, SentFrame


def sent(*payloads: bytes, most: int = 10) -> FakeConduit:
    conduit = FakeConduit(most)
    for payload in payloads:
        conduit.send(b"h", payload)
    return conduit


def test_frames_wait_until_they_are_let_through_in_any_order() -> None:
    conduit = sent(b"a", b"b", b"c")
    assert len(conduit) == 3
    assert conduit.take(4) == SentFrame(b"h", b"b")
    assert conduit.take() == SentFrame(b"h", b"a")
    assert conduit.take(keep=True) == conduit.take() == SentFrame(b"h", b"c")
    assert conduit.take() is None


def test_frames_are_lost_by_wish_and_beyond_the_cap() -> None:
    conduit = sent(b"a", b"b", b"c", b"d", most=3)
    assert conduit.lost == 1
    conduit.lose(1)
    conduit.cut()
    conduit.lose(0)
    assert (len(conduit), conduit.lost) == (0, 4)
