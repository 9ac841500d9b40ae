"""The hellos that a republisher says: when, and which answers it still understands."""

from __future__ import annotations

from collections import OrderedDict

from beacon_core.relay.settings import Republishing

__all__ = ["Greeting", "pause_ns"]

_MAX_REMEMBERED = 64
"""Hellos whose answer is still understood."""


class Greeting:
    """Thread rule: none of its own."""

    def __init__(self, settings: Republishing, now_ns: int) -> None:
        self._settings = settings
        self._said: OrderedDict[int, int] = OrderedDict()
        # Number of each, and when.
        self._last = 0
        self._asks = 0
        self.free_ns = now_ns
        """When the next one may be said."""

    @property
    def tired(self) -> bool:
        """It has been said often enough without an answer."""
        return self._asks >= self._settings.max_asks

    def say(self, now_ns: int) -> int:
        """The number of the next one; the one after that may come after twice as long."""
        self._last += 1
        self._said[self._last] = now_ns
        if len(self._said) > _MAX_REMEMBERED:
            self._said.popitem(last=False)
        self.free_ns = now_ns + pause_ns(self._settings, self._asks)
        self._asks += 1
        return self._last

    def said_ns(self, number: int) -> int | None:
        """When the hello of this number was said; ``None`` if it was not, or long ago."""
        return self._said.get(number)

    def answered(self) -> None:
        """Somebody has told all that he has."""
        self._asks = 0


def pause_ns(settings: Republishing, asks: int) -> int:
    """How long to wait after having asked ``asks`` times before: twice as long each time."""
    return min(settings.ask_first_ns << min(asks, 16), settings.ask_most_ns)
