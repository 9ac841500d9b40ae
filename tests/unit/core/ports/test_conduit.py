"""The conduit's port: small enough to write one down, and checked to be one by mypy."""

from __future__ import annotations

import inspect

from beacon_core.ports import conduit
from beacon_core.ports.conduit import Conduit, ConduitLimits, FrameSink


class Tin:
    """Two tins and a string, for somebody who listens to himself."""

    sink: FrameSink | None = None

    def start(self, sink: FrameSink) -> None:
        self.sink = sink
        sink.link(up=True)

    def send(self, header: bytes, payload: bytes) -> bool:
        if self.sink is not None:
            self.sink.frame(header, payload)
        return self.sink is not None

    def limits(self) -> ConduitLimits:
        return ConduitLimits(2**17, 2**20)

    def close(self) -> None:
        self.sink = None


class Ear:
    def __init__(self) -> None:
        self.heard: list[object] = []

    def frame(self, header: bytes, payload: bytes) -> None:
        self.heard.append((header, payload))

    def link(self, *, up: bool) -> None:
        self.heard.append(up)


def test_four_methods_make_a_conduit() -> None:
    ear = Ear()
    port: Conduit = Tin()
    port.start(ear)
    assert port.send(b"h", b"p")
    port.close()
    assert not port.send(b"h", b"p")
    assert ear.heard == [True, (b"h", b"p")]
    assert port.limits().max_header_bytes == 2**17


def test_the_port_says_its_thread_rule() -> None:
    assert "Thread rule" in (inspect.getdoc(conduit.Conduit) or "")
