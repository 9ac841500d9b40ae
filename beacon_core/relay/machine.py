"""What both sides of the relay have in common: the time, what is due, and what is to be done."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

from beacon_core.relay.alarms import Alarms
from beacon_core.relay.effects import Arm, Effect

__all__ = ["Machine"]

_K = TypeVar("_K", bound=Hashable)


class Machine(Generic[_K]):
    """Each public method of a side begins with ``_at`` and ends with ``_done``.

    Thread rule: none of its own.
    """

    def __init__(self, now_ns: int) -> None:
        self._now_ns = now_ns
        self._alarms: Alarms[_K] = Alarms()
        self._effects: list[Effect] = []
        self._armed: int | None = None

    def _at(self, now_ns: int) -> None:
        """It is so late now; a clock that goes back counts as standing still."""
        if now_ns > self._now_ns:  # noqa: PLR1730 - max is a call
            self._now_ns = now_ns

    def _done(self) -> list[Effect]:
        """What is to be done, and when to call again, if that has changed."""
        if self._alarms.changed:
            self._alarms.changed = False
            due_ns = self._alarms.next_ns()
            if due_ns != self._armed:
                self._armed = due_ns
                self._effects.append(Arm(due_ns))
        if not self._effects:
            return []
        effects = self._effects.copy()
        self._effects.clear()
        return effects
