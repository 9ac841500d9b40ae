"""How many requests a minute are answered: per client, per client and path, and in all.

A bucket holds one minute's worth and refills steadily; it is kept as the moment at which it would
be full again. A request must find room in its client's bucket and in that of all; one that is
turned away takes nothing from either.
"""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping

import attrs

from beacon_gateway.access.asked import Asked, Headers, Refusal
from beacon_gateway.access.options import RateLimitConfig
from beacon_gateway.access.roles import pattern

__all__ = ["MAX_CLIENTS", "RateLimiter"]

MAX_CLIENTS = 10_000
"""Buckets of clients: a megabyte or two. Beyond it whoever asked longest ago is forgotten, and
may begin anew."""

_MINUTE_S = 60.0
_ALL = ("", "")


@attrs.frozen
class _Room:
    """What one bucket says about a request."""

    limit: int
    remaining: int
    wait_s: float
    """Until there is room for one; 0 if there is."""
    full_s: float
    """Until it is full again."""


class RateLimiter:
    """Thread rule: every method may be called from any thread."""

    def __init__(
        self,
        config: RateLimitConfig,
        *,
        always: Mapping[str, int] | None = None,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """``always``: requests per minute of one client for these paths, also where no limit is
        enabled. ``now_s`` never goes back."""
        self._enabled = config.enabled
        self._client_rpm, self._global_rpm = config.client_rpm, config.global_rpm
        overrides = [entry.rpartition(":") for entry in config.endpoints if config.enabled]
        rules = {**(always or {}), **{path: int(rpm) for path, _, rpm in overrides}}
        self._rules = [(pattern(path), path, rpm) for path, rpm in rules.items()]
        self._now_s = now_s
        self._lock = threading.Lock()
        self._full_at_s: OrderedDict[tuple[str, str], float] = OrderedDict()
        self._all_full_at_s = 0.0

    def check(self, asked: Asked, headers: Headers) -> Refusal | None:
        """Adds to the answer's headers, and refuses what is too much."""
        key, rpm = self._rule(asked)
        if not rpm:
            return None
        with self._lock:
            now_s = self._now_s()
            room = _look(self._full_at_s.get(key, 0.0), rpm, now_s)
            total = _look(self._all_full_at_s, self._global_rpm, now_s)
            if not room.wait_s and self._enabled and total.wait_s:
                room = total
            if not room.wait_s:
                self._take(key, rpm, now_s)
                room = _look(self._full_at_s[key], rpm, now_s)
                room = attrs.evolve(room, wait_s=0.0)
        return self._told(room, headers)

    def _rule(self, asked: Asked) -> tuple[tuple[str, str], int]:
        for expression, path, rpm in self._rules:
            if expression.fullmatch(asked.path.rstrip("/")):
                return (asked.network, path), rpm
        return (asked.network, ""), self._client_rpm if self._enabled else 0

    def _take(self, key: tuple[str, str], rpm: int, now_s: float) -> None:
        self._full_at_s[key] = max(now_s, self._full_at_s.get(key, 0.0)) + _MINUTE_S / rpm
        self._full_at_s.move_to_end(key)
        if len(self._full_at_s) > MAX_CLIENTS:
            self._full_at_s.popitem(last=False)
        if self._enabled:
            self._all_full_at_s = max(now_s, self._all_full_at_s) + _MINUTE_S / self._global_rpm

    def _told(self, room: _Room, headers: Headers) -> Refusal | None:
        reset = math.ceil(time.time() + room.full_s)
        headers.extend(
            [
                (b"x-ratelimit-limit", b"%d" % room.limit),
                (b"x-ratelimit-remaining", b"%d" % room.remaining),
                (b"x-ratelimit-reset", b"%d" % reset),
            ]
        )
        if not room.wait_s:
            return None
        retry_after = math.ceil(room.wait_s)
        return Refusal(
            429,
            "rate-limit-exceeded",
            "Too many requests. Please retry after the specified time.",
            {"retry_after": retry_after, "limit": room.limit, "reset": reset},
            [(b"retry-after", b"%d" % retry_after)],
        )


def _look(full_at_s: float, rpm: int, now_s: float) -> _Room:
    step_s = _MINUTE_S / rpm
    full_s = max(0.0, full_at_s - now_s)
    # The rounding of the sums must not cost a request that is due.
    remaining = math.floor((_MINUTE_S - full_s) / step_s + 1e-6)
    wait_s = 0.0 if remaining >= 1 else full_s + step_s - _MINUTE_S
    return _Room(rpm, max(0, remaining), wait_s, full_s)
