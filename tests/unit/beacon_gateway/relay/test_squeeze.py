"""What a conduit carries is compressed where that gains, and comes out as it went in."""

from __future__ import annotations

import random

import pytest
import zstandard

from beacon_core.relay.frames import FLAGS_AT, Content, Malformed, Reset, decode, encode
from beacon_gateway.relay.squeeze import SqueezingConduit
from tests.unit.beacon_gateway.relay.test_end import Wire

TEXT = b"a line of text that says much the same as the line before it\n" * 20


class Told:
    def __init__(self) -> None:
        self.frames: list[tuple[bytes, bytes]] = []
        self.up: list[bool] = []

    def frame(self, header: bytes, payload: bytes) -> None:
        self.frames.append((header, payload))

    def link(self, *, up: bool) -> None:
        self.up.append(up)


def content(payload: bytes, route: int = 1, seq: int = 0) -> tuple[bytes, bytes]:
    return encode(Content(7, 1, route, seq, 0, payload, 7))


def noise(size: int, seed: int = 1) -> bytes:
    return random.Random(seed).randbytes(size)  # noqa: S311


@pytest.fixture
def wire() -> Wire:
    return Wire()


def opened(wire: Wire, *, squeezes: bool = True) -> tuple[SqueezingConduit, Told]:
    conduit, told = SqueezingConduit(wire, squeezes=squeezes), Told()
    conduit.start(told)
    return conduit, told


def squeezed(wire: Wire) -> list[bool]:
    return [header[FLAGS_AT] != 0 for header, _ in wire.sent]


@pytest.mark.parametrize("payload", [b"", b"x", TEXT, noise(5000), bytes(100_000)])
def test_what_comes_out_is_what_went_in(wire: Wire, payload: bytes) -> None:
    conduit, told = opened(wire)
    sent = content(payload)
    assert conduit.send(*sent)
    assert wire.sink is not None
    wire.sink.frame(*wire.sent[0])
    assert told.frames == [sent]


def test_text_is_sent_smaller_and_noise_as_it_is(wire: Wire) -> None:
    conduit, _ = opened(wire)
    conduit.send(*content(TEXT, route=1))
    conduit.send(*content(noise(5000), route=2))
    conduit.send(*content(b"short", route=1))
    assert squeezed(wire) == [True, False, False]
    assert len(wire.sent[0][1]) < len(TEXT) / 5


def test_only_contents_are_compressed(wire: Wire) -> None:
    conduit, _ = opened(wire)
    conduit.send(*encode(Reset(7, 1, 3)))
    assert squeezed(wire) == [False]


def test_an_end_that_does_not_compress_takes_what_is_compressed(wire: Wire) -> None:
    plain, told = opened(wire, squeezes=False)
    other = Wire()
    conduit, _ = opened(other)
    conduit.send(*content(TEXT))
    assert wire.sink is not None
    wire.sink.frame(*other.sent[0])
    assert told.frames == [content(TEXT)]
    plain.send(*content(TEXT))
    assert squeezed(wire) == [False]


def barely(seed: int) -> bytes:
    """Shrinks, but by less than a sixth."""
    return noise(900, seed) + bytes(100)


def test_a_route_that_does_not_gain_is_left_alone_and_tried_again_later(wire: Wire) -> None:
    conduit, _ = opened(wire)
    for seed in range(20):
        conduit.send(*content(barely(seed)))
    assert squeezed(wire) == [True] * 20
    wire.sent.clear()
    for seed in range(1000):
        conduit.send(*content(barely(seed)))
    assert not any(squeezed(wire))
    conduit.send(*content(TEXT))
    assert squeezed(wire)[-1]


def test_a_route_that_gains_no_more_is_left_alone_though_others_still_gain(wire: Wire) -> None:
    conduit, _ = opened(wire)
    for _ in range(20):
        conduit.send(*content(TEXT, route=1))
        conduit.send(*content(TEXT, route=2))
    for seed in range(1000):
        conduit.send(*content(barely(seed), route=1))
    conduit.send(*content(TEXT, route=1))
    conduit.send(*content(TEXT, route=2))
    assert squeezed(wire)[-2:] == [False, True]


def test_routes_beyond_number_are_forgotten_not_kept(wire: Wire) -> None:
    conduit, _ = opened(wire)
    for route in range(5000):
        conduit.send(*content(TEXT, route=route))
    assert len(conduit._routes) == 4096


@pytest.mark.parametrize(
    "payload",
    [
        b"no zstandard",
        zstandard.compress(TEXT)[:-5],
        zstandard.compress(bytes(2**21)),  # above what the conduit carries
    ],
)
def test_what_cannot_be_unpacked_is_no_frame(wire: Wire, payload: bytes) -> None:
    _, told = opened(wire)
    header, _ = content(b"")
    assert wire.sink is not None
    wire.sink.frame(header[:FLAGS_AT] + b"\x80" + header[FLAGS_AT + 1 :], payload)
    ((header, payload),) = told.frames
    assert isinstance(decode(header, payload), Malformed)


def test_all_else_is_the_inner_ones(wire: Wire) -> None:
    conduit, told = opened(wire)
    assert conduit.limits() == wire.limits()
    assert wire.sink is not None
    wire.sink.link(up=True)
    assert told.up == [True]
    conduit.close()
    assert wire.sink is None
