"""What is wrong with those who should be asked, in words for people."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["complaints"]

_SHOWN = 3
"""Nodes that are named for one reason; of the others the number is told."""


def complaints(silent: Sequence[str], absent: Sequence[str], namesakes: Sequence[str]) -> str:
    """About nodes that do not answer, targets that are not in the graph, and names that several
    nodes have; ``""`` if there is nothing to complain of."""
    return "; ".join(
        [
            *_about(silent, "does not answer", "do not answer"),
            *_about(absent, "is not in the ROS graph", "are not in the ROS graph"),
            *_about(
                namesakes,
                "is the name of several nodes; rename them",
                "are the names of several nodes each; rename them",
            ),
        ]
    )


def _about(names: Sequence[str], one: str, several: str) -> list[str]:
    if not names:
        return []
    if len(names) == 1:
        return [f"{names[0]} {one}"]
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return [f"{', '.join(names[:_SHOWN])}{more} {several}"]
