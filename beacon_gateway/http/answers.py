"""Answers as bytes."""

from __future__ import annotations

import json
from typing import Any

import orjson
from starlette.responses import Response

from beacon_gateway.http.models.base import as_plain

__all__ = ["JSON", "answer", "to_json"]

JSON = "application/json"


def answer(body: object, status: int = 200) -> Response:
    """A body (see :mod:`beacon_gateway.http.models`) or plain data, as JSON."""
    return Response(to_json(as_plain(body)), status, media_type=JSON)


def to_json(plain: Any) -> bytes:
    """JSON that can always be sent: half a surrogate pair becomes a question mark."""
    try:
        return orjson.dumps(plain)
    except TypeError:
        text = json.dumps(plain, ensure_ascii=False, separators=(",", ":"))
        return text.encode("utf-8", errors="replace")
