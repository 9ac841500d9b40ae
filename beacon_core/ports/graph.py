"""A source whose carrier knows who takes part in it, whether or not they announce anything."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

__all__ = ["Graph"]


@runtime_checkable
class Graph(Protocol):
    """What a :class:`~beacon_core.ports.source.HintSource` may offer besides: the ROS graph.

    Thread rule: any thread, at any time, also before ``start`` and after ``close``.
    """

    def nodes(self) -> frozenset[str]:
        """The full names of all nodes, such as ``/arm/driver``, as far as discovery has come.

        Never raises; what cannot be known (yet, or any more) is not in it. A gateway asks at each
        request, so it must be cheap, and may be some seconds old. Without a change it is the same
        object.
        """
