"""The bodies of requests: small JSON objects, looked at field by field."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import orjson
from starlette.requests import Request

from beacon_gateway.http import errors
from beacon_gateway.http.models.subscriptions import Interval

__all__ = ["MAX_DURATION_S", "body_of", "duration_of", "interval_of", "text_of"]

MAX_DURATION_S = 3600
"""As there: who wants more asks again."""

_SHOWN = 256


async def body_of(request: Request) -> Mapping[str, Any]:
    """The object in a request's body. Raises ``ApiError``."""
    # How long it may be is seen to in front of the application.
    try:
        given = orjson.loads(await request.body())
    except orjson.JSONDecodeError as error:
        raise errors.invalid_request("Request body is not JSON", details=str(error)) from error
    if not isinstance(given, dict):
        raise errors.invalid_request("Request body is not a JSON object")
    return given


def text_of(given: Mapping[str, Any], name: str, default: str | None = None) -> str:
    """A text. Raises ``ApiError`` if it is missing or something else."""
    value = given.get(name)
    if value is None:
        value = default
    if not isinstance(value, str):
        raise errors.invalid_parameter(f"Invalid {name}. Must be a string.", parameter=name)
    return value


def interval_of(given: Mapping[str, Any]) -> Interval:
    """How often. Raises ``ApiError``."""
    value = given.get("interval")
    if not isinstance(value, str) or value not in set(Interval):
        raise errors.invalid_parameter(
            "Invalid interval. Must be 'fast', 'normal', or 'slow'.",
            parameter="interval",
            value=str(value)[:_SHOWN],
        )
    return Interval(value)


def duration_of(given: Mapping[str, Any]) -> int:
    """For how many seconds. Raises ``ApiError``."""
    value = given.get("duration")
    if not isinstance(value, int) or isinstance(value, bool) or value <= 0:
        raise errors.invalid_parameter(
            "Duration must be a positive integer (seconds).",
            parameter="duration",
            value=str(value)[:_SHOWN],
        )
    if value > MAX_DURATION_S:
        raise errors.invalid_parameter(
            f"Duration must not exceed {MAX_DURATION_S} seconds.",
            parameter="duration",
            max_value=MAX_DURATION_S,
        )
    return value
