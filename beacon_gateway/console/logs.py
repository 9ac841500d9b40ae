"""Logging for the ``beacon`` command: to stderr, one line each."""

from __future__ import annotations

import logging
import sys

from beacon_gateway.config import LogLevel

__all__ = ["set_up_logging"]


def set_up_logging(level: LogLevel) -> None:
    """Send everything from ``level`` up to stderr."""
    logging.basicConfig(
        level=level.value.upper(),
        format="%(asctime)s %(levelname)-7s %(name)s: %(message)s",
        stream=sys.stderr,
        force=True,
    )
    # Its start and stop say nothing that ours do not.
    logging.getLogger("uvicorn").setLevel(logging.WARNING)
