"""A conduit between relays that does to frames what the test wants: it loses, repeats, reorders.

Nothing happens by itself, and nothing by chance: what is sent waits until somebody lets it through.
"""

from __future__ import annotations

import attrs

__all__ = ["FakeConduit", "SentFrame"]


@attrs.frozen
class SentFrame:
    """A frame under way."""

    header: bytes
    payload: bytes


class FakeConduit:
    """One way from one side to the other. Thread rule: none of its own."""

    def __init__(self, most: int = 10_000) -> None:
        """``most`` frames under way; more are lost."""
        self._most = most
        self._under_way: list[SentFrame] = []
        self.lost = 0
        """Frames that never got through, for whatever reason."""

    def __len__(self) -> int:
        return len(self._under_way)

    def send(self, header: bytes, payload: bytes) -> None:
        """Take a frame; it is under way now."""
        if len(self._under_way) < self._most:
            self._under_way.append(SentFrame(header, payload))
        else:
            self.lost += 1

    def take(self, at: int = 0, *, keep: bool = False) -> SentFrame | None:
        """Let the frame at this place through; ``keep`` it too, to come again. Wraps round."""
        if not self._under_way:
            return None
        at %= len(self._under_way)
        return self._under_way[at] if keep else self._under_way.pop(at)

    def lose(self, at: int, count: int = 1) -> None:
        """Lose so many from this place on."""
        if self._under_way:
            at %= len(self._under_way)
            self.lost += len(self._under_way[at : at + count])
            del self._under_way[at : at + count]

    def cut(self) -> None:
        """Lose all that is under way."""
        self.lose(0, len(self._under_way))
