"""A source that knows who takes part is told apart from one that does not."""

from __future__ import annotations

from beacon_core.ports.graph import Graph


class Knows:
    def nodes(self) -> frozenset[str]:
        return frozenset({"/arm/driver"})


class DoesNot:
    pass


def test_whoever_tells_its_nodes_knows_the_graph() -> None:
    assert isinstance(Knows(), Graph)
    assert not isinstance(DoesNot(), Graph)
