"""One publisher as the relay's core knows it: a ROS publisher, and siblings of other marks.

Theory. A core's publisher carries messages that other forwarders took first, or that have passed
more relays, only now and then; its own mark fits nearly all. What has another one goes out by a
sibling, made when it is needed. A publisher is heard once it has matched, so a sibling's messages
wait until it has matched whom the main one has, or for half a second; and since messages stay in
order, all that come after them wait too::

    nothing is held   --a message of a known mark--> published at once, by the caller
                      --a message of a new mark---> it is held, and all that follow
    something is held --the sibling has matched, or it has waited long enough--> all go out
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

from beacon_core.relay.effects import CreatePublisher, Publish
from beacon_core.relay.marks import Mark
from beacon_ros_topic.relay.voice import Voice

__all__ = ["Offer"]

_MATCH_WITHIN_S = 0.5
_MOST_HELD_BYTES = 32 * 1024 * 1024
"""More than this does not wait any longer."""


class Offer:
    """Thread rule: any thread; ``close`` as the last."""

    def __init__(self, what: CreatePublisher) -> None:
        self.what = what
        self.told: tuple[int, int] | None = None
        """What the watcher was told last of whom it has matched."""
        self.expected = 0
        """How many subscriptions the graph shows that it could have."""
        self._lock = threading.Lock()
        self._held: deque[Publish] = deque()
        self._held_bytes = 0
        self._voices: dict[Mark, Voice] = {}
        self._waits_until: dict[Mark, float] = {}
        self._main: Voice | None = None

    @property
    def mark(self) -> Mark:
        """Of the main publisher."""
        return self.what.first, 1

    @property
    def made(self) -> bool:
        """Has it a publisher?"""
        return self._main is not None

    def open(self, main: Voice) -> None:
        """It is made; what is held may go out."""
        with self._lock:
            self._main = self._voices[self.mark] = main

    def publish(self, what: Publish) -> bool:
        """Publish, or hold; ``False`` if it is held, and the owner is to call :meth:`flush` soon.

        Raises ``RuntimeError`` if ROS refuses.
        """
        with self._lock:
            voice = None if self._held else self._voices.get((what.first, what.hop))
            if voice is None or (what.first, what.hop) in self._waits_until:
                self._held.append(what)
                self._held_bytes += len(what.payload)
                return False
            voice.send(what.payload)
            return True

    def flush(self, sibling: Callable[[Offer, Mark], Voice], *, at_once: bool = False) -> bool:
        """Let out what may go; says whether something is still held.

        ``sibling`` makes one, or gives the main one if there can be no more of them. Raises
        ``RuntimeError`` if ROS refuses.
        """
        with self._lock:
            while self._held and self._main is not None:
                mark = self._held[0].first, self._held[0].hop
                if mark not in self._voices:
                    self._voices[mark] = sibling(self, mark)
                    self._waits_until[mark] = time.monotonic() + _MATCH_WITHIN_S
                if not at_once and self._must_wait(mark, self._main):
                    break
                self._waits_until.pop(mark, None)
                what = self._held.popleft()
                self._held_bytes -= len(what.payload)
                self._voices[mark].send(what.payload)
            return bool(self._held)

    def count(self) -> int:
        """How many subscriptions the main publisher has; 0 before it is made."""
        with self._lock:
            return 0 if self._main is None else self._main.count()

    def acknowledged(self) -> bool:
        """Do all who are to hear have all that was published?"""
        with self._lock:
            return all(voice.acknowledged() for voice in self._voices.values())

    def gids(self) -> list[bytes]:
        """Of all its publishers."""
        with self._lock:
            return [voice.gid for voice in self._voices.values()]

    def close(self) -> None:
        """End all of its publishers."""
        with self._lock:
            for voice in {id(voice): voice for voice in self._voices.values()}.values():
                voice.close()
            self._voices.clear()
            self._held.clear()
            self._main = None

    def _must_wait(self, mark: Mark, main: Voice) -> bool:
        return (
            mark in self._waits_until
            and self._voices[mark].count() < main.count()
            and time.monotonic() < self._waits_until[mark]
            and self._held_bytes <= _MOST_HELD_BYTES
        )
