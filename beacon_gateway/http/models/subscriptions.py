"""Cyclic subscriptions: a resource, sent again and again for a while."""

from __future__ import annotations

import enum
from collections.abc import Sequence

import attrs

from beacon_gateway.http.models.discovery import Listing

__all__ = [
    "CyclicSubscription",
    "CyclicSubscriptionCreateRequest",
    "CyclicSubscriptionList",
    "CyclicSubscriptionUpdateRequest",
    "Interval",
]


class Interval(enum.StrEnum):
    """How often: each 50, 200 or 500 ms."""

    FAST = "fast"
    NORMAL = "normal"
    SLOW = "slow"


@attrs.frozen(kw_only=True)
class CyclicSubscription:
    """One subscription: what is sent, how often, and where it can be read."""

    id: str
    observed_resource: str
    event_source: str
    protocol: str
    interval: Interval


@attrs.frozen(kw_only=True)
class CyclicSubscriptionList(Listing):
    """The subscriptions of one entity."""

    items: Sequence[CyclicSubscription]


@attrs.frozen(kw_only=True)
class CyclicSubscriptionCreateRequest:
    """What to send, how often, and for how many seconds."""

    resource: str
    interval: str
    duration: int
    protocol: str | None = None


@attrs.frozen(kw_only=True)
class CyclicSubscriptionUpdateRequest:
    """Another pace, or another time to go on from now, in seconds."""

    interval: str | None = None
    duration: int | None = None
