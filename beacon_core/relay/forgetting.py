"""Forwarders that nobody has heard for long give way to new ones, and nothing of them comes twice.

Theory. The number of forwarders that a republisher follows is capped. When another one comes and
there is no room, the one that was heard least recently gives way, if it has been silent for
``forget_ns`` of a time in which there was a link, and nothing is left of it: nothing held, missing
or asked for, no topic published. A forwarder that lives is heard each second, whatever it has to
say, so only one that is gone, or cut off, gives way.

It may come back, even in the same life. Then it must answer a hello that was said after it was
forgotten, and is treated as one that was there before we were: of what it has by then, nothing is
wanted, and only later messages are published. A life before the one that was known is not believed
again. Of a route that was known, not even the last state is wanted: it has been published.

What must be known for that is remembered of the last ``MAX_REMEMBERED`` forgotten ones. For whoever
might be one of those before them, the time when the last of these was forgotten is enough: but
state may be published again, as after a restart of ours.
"""

from __future__ import annotations

from collections import OrderedDict

import attrs

from beacon_core.relay.peer import Peer
from beacon_core.relay.settings import Republishing

__all__ = ["MAX_REMEMBERED", "Forgotten", "Memory"]

MAX_REMEMBERED = 1024
"""Forgotten forwarders of which each is known by itself: 100 KB."""


@attrs.frozen
class Memory:
    """What is known of a forwarder that is not followed."""

    since_ns: int
    """Whatever it said before is not believed; what it had before is not wanted."""
    epoch: int = -1
    """Its life: none before is believed."""
    routes: int = 0
    """Its routes in that life up to this number have been published."""


class Forgotten:
    """Thread rule: none of its own."""

    def __init__(self, settings: Republishing, began_ns: int) -> None:
        """``began_ns``: when we began; whatever was sent before is not wanted of anybody."""
        self._settings = settings
        self._anybody = self._others = Memory(began_ns)
        self._of: OrderedDict[int, Memory] = OrderedDict()

    def recall(self, origin: int, epoch: int, *, followed: bool) -> Memory:
        """What is known of this life of a forwarder, which has not been joined yet."""
        if followed:
            return self._anybody
        memory = self._of.get(origin, self._others)
        # Nothing of a new life has been published.
        return self._anybody if epoch > memory.epoch >= 0 else memory

    def follow(self, origin: int) -> None:
        """It has been joined, and need not be remembered."""
        self._of.pop(origin, None)

    def make_room(self, peers: dict[int, Peer], now_ns: int, *, linked: bool) -> bool:
        """For another one: whether there is any, maybe because one of the peers has given way."""
        if len(peers) < self._settings.max_origins:
            return True
        silent_since_ns = now_ns - self._settings.forget_ns
        silent = (one for one in peers.values() if one.heard_ns <= silent_since_ns and one.idle)
        given = min(silent, key=lambda one: one.heard_ns, default=None)
        if given is None or not linked:
            return False
        del peers[given.origin]
        self._remember(given, now_ns)
        return True

    def _remember(self, peer: Peer, now_ns: int) -> None:
        # What is said in this very moment may have been said before.
        self._of[peer.origin] = Memory(now_ns + 1, peer.epoch, max(peer.known, default=0))
        if len(self._of) > MAX_REMEMBERED:
            _, oldest = self._of.popitem(last=False)
            self._others = Memory(oldest.since_ns)
