"""Roles, and what each may do, as one table.

Each role may do what the one before it may. A path is matched step by step: ``*`` stands for one
step, ``**`` at the end for all that follow. Unlike in ros2_medkit a viewer may read everything, the
beacons too: there no role but admin may, so a viewer of that gateway sees none.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Mapping
from functools import cache

__all__ = ["PERMISSIONS", "Level", "Role", "may", "pattern"]

_WRITES = "POST|PUT|PATCH|DELETE"
_READS = frozenset({"GET", "HEAD", "OPTIONS"})


class Role(enum.StrEnum):
    """From the least to the most powerful."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    CONFIGURATOR = "configurator"
    ADMIN = "admin"


class Level(enum.StrEnum):
    """What needs a token at all."""

    NONE = "none"
    WRITE = "write"
    """Everything but GET, HEAD and OPTIONS."""
    ALL = "all"

    def covers(self, method: str) -> bool:
        """Does a request with this method need one?"""
        return self is Level.ALL or (self is Level.WRITE and method not in _READS)


PERMISSIONS: Mapping[Role, tuple[tuple[str, str], ...]] = {
    Role.VIEWER: (("GET|HEAD|OPTIONS", "/**"),),
    Role.OPERATOR: (
        (_WRITES, "/api/v1/*/*/cyclic-subscriptions/**"),
        (_WRITES, "/api/v1/*/*/operations/**"),
    ),
    Role.CONFIGURATOR: ((_WRITES, "/api/v1/*/*/configurations/**"),),
    Role.ADMIN: ((_WRITES, "/**"),),
}
"""What each role may do beyond the one before it: methods, and where."""


def may(role: Role, method: str, path: str) -> bool:
    """May somebody with that role send this?"""
    return any(
        method in methods and where.fullmatch(path.rstrip("/") or "/")
        for methods, where in _allowed(role)
    )


@cache
def pattern(path: str) -> re.Pattern[str]:
    """The expression of a path with ``*`` and ``**`` in it."""
    steps = path.removesuffix("/**").split("/")
    steps = ["[^/]+" if step == "*" else re.escape(step) for step in steps]
    return re.compile("/".join(steps) + ("(/.*)?" if path.endswith("/**") else ""), re.DOTALL)


@cache
def _allowed(role: Role) -> tuple[tuple[frozenset[str], re.Pattern[str]], ...]:
    roles = list(Role)
    upto = roles[: roles.index(role) + 1]
    return tuple(
        (frozenset(methods.split("|")), pattern(where))
        for one in upto
        for methods, where in PERMISSIONS[one]
    )
