"""A client is what has the port's methods; its factory is told a name and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from beacon_core.ports.asking import ClientFactory, Done, Drop, NodeClient


class Echo:
    """Answers at once, whatever it is asked."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.closed = False

    def ready(self) -> bool:
        return not self.closed

    def list_names(self, done: Done) -> Drop:
        done([self.name])
        return lambda: None

    def get_values(self, names: Sequence[str], done: Done) -> Drop:
        done([*names])
        return lambda: None

    def close(self) -> None:
        self.closed = True


def test_a_client_is_made_of_a_name_and_asked_until_it_is_closed() -> None:
    factory: ClientFactory = Echo
    client: NodeClient = factory("/engine")
    heard: list[Sequence[Any] | None] = []
    client.list_names(heard.append)()
    client.get_values(["a", "b"], heard.append)()
    assert heard == [["/engine"], ["a", "b"]]
    client.close()
    assert not client.ready()
