"""A source that must be told whom to ask is known by its one method."""

from __future__ import annotations

from beacon_core.ports.targeted import Targeted


class Asking:
    def __init__(self) -> None:
        self.nodes: frozenset[str] | None = None

    def set_targets(self, nodes: frozenset[str] | None) -> None:
        self.nodes = nodes


class Listening:
    pass


def test_who_can_be_told_is_told_from_who_cannot() -> None:
    assert isinstance(Asking(), Targeted)
    assert not isinstance(Listening(), Targeted)


def test_the_nodes_are_given_or_left_to_the_source() -> None:
    source = Asking()
    told: Targeted = source
    told.set_targets(frozenset({"/arm/driver"}))
    assert source.nodes == frozenset({"/arm/driver"})
    told.set_targets(None)
    assert source.nodes is None
