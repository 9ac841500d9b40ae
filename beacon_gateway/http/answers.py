"""Answers as bytes."""

from __future__ import annotations

from starlette.responses import Response

from beacon_gateway.http.models.base import as_plain
from beacon_gateway.writing import JSON, to_json

__all__ = ["answer"]


def answer(body: object, status: int = 200) -> Response:
    """A body (see :mod:`beacon_gateway.http.models`) or plain data, as JSON."""
    return Response(to_json(as_plain(body)), status, media_type=JSON)
