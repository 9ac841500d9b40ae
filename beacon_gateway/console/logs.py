"""Logging for the ``beacon`` command: to stderr, one line each."""

from __future__ import annotations

import datetime as dt
import json
import logging
import sys

from beacon_gateway.config import LogFormat, LogLevel

__all__ = ["JsonLines", "set_up_logging"]

_TEXT = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"


def set_up_logging(level: LogLevel, form: LogFormat = LogFormat.TEXT) -> None:
    """Send everything from ``level`` up to stderr. May be called again."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines() if form is LogFormat.JSON else logging.Formatter(_TEXT))
    logging.basicConfig(level=level.value.upper(), handlers=[handler], force=True)
    # Its start and stop say nothing that ours do not, and its warnings are about what strangers
    # send: nothing that may fill a log.
    logging.getLogger("uvicorn").setLevel(logging.ERROR)


class JsonLines(logging.Formatter):
    """One JSON object per line, for whatever collects logs."""

    def format(self, record: logging.LogRecord) -> str:
        """``time`` (UTC), ``level``, ``logger``, ``message``, and ``exception`` if there is one."""
        at = dt.datetime.fromtimestamp(record.created, dt.UTC)
        line = {
            "time": at.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)
