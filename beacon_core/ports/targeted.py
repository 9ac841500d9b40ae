"""A source that asks, rather than being told, and so must know whom."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

__all__ = ["Targeted"]


@runtime_checkable
class Targeted(Protocol):
    """What a :class:`~beacon_core.ports.source.HintSource` may offer besides.

    Thread rule: any thread, at any time, also before ``start`` and after ``close``.
    """

    def set_targets(self, nodes: frozenset[str] | None) -> None:
        """Ask these nodes from now on, and no others: the nodes of the gateway's apps.

        Each is a node's full name as its carrier has it, such as ``/arm/driver``; one that is not
        there (yet) is no error. ``None``: find out yourself whom to ask, as before the first call.
        """
