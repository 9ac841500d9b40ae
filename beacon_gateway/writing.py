"""JSON as it is sent."""

from __future__ import annotations

import json
from typing import Any

import orjson

__all__ = ["JSON", "to_json"]

JSON = "application/json"
"""The media type of nearly everything that is answered."""


def to_json(plain: Any) -> bytes:
    """JSON that can always be sent: half a surrogate pair becomes a question mark."""
    try:
        return orjson.dumps(plain)
    except TypeError:
        text = json.dumps(plain, ensure_ascii=False, separators=(",", ":"))
        return text.encode("utf-8", errors="replace")
