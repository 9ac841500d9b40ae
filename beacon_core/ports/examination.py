"""What an adapter finds when it is asked why nothing is heard."""

from __future__ import annotations

import enum

import attrs

__all__ = ["Finding", "Level"]


class Level(enum.StrEnum):
    """How much a finding matters to somebody whose view is empty."""

    OK = "ok"
    """As it should be."""
    NOTE = "note"
    """Worth knowing; it may be meant so."""
    PROBLEM = "problem"
    """It keeps hints from being heard, or nobody says any."""


@attrs.frozen
class Finding:
    """One thing that was looked at. What strangers say may be in it: escape it for a terminal."""

    level: Level
    what: str
    """One line: what was seen, with names and numbers."""
    advice: str = ""
    """One line: what to do about it. Empty where nothing need be done."""
