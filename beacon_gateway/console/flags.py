"""Argument types that several subcommands share."""

from __future__ import annotations

import argparse
import math

__all__ = ["port", "seconds"]


def seconds(text: str) -> float:
    """A duration in seconds, from 0.01 to a million."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if 0.01 <= value <= 1e6:
        return value
    raise argparse.ArgumentTypeError(f"{text!r} is no number of seconds from 0.01 to 1000000")


def port(text: str) -> int:
    """A TCP port; 0 means any free one."""
    if text.isascii() and text.isdigit() and int(text) <= 65535:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is no port, 0 to 65535")
