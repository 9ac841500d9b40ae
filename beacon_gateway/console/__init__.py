"""What the subcommands share: how they end, what they print, whom they ask."""

from __future__ import annotations

__all__: list[str] = []
