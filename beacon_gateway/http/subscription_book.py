"""Which cyclic subscriptions there are: capped, and each for a limited time."""

from __future__ import annotations

import threading

import attrs

from beacon_core.clock import Clock
from beacon_gateway.http.models.subscriptions import Interval

__all__ = ["MAX_SUBSCRIPTIONS", "Subscription", "SubscriptionBook"]

MAX_SUBSCRIPTIONS = 100
"""At their fastest they make 2,000 answers a second."""


@attrs.frozen
class Subscription:
    """One resource of one entity, sent again and again."""

    id: str
    collection: str
    entity_id: str
    resource: str
    """The address, as the client gave it."""
    within: str
    """What of the address comes after the entity."""
    interval: Interval
    expires_ns: int
    """On the monotonic clock."""


class SubscriptionBook:
    """Thread rule: every method may be called from any thread."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._known: dict[str, Subscription] = {}
        self._count = 0

    def add(
        self,
        collection: str,
        entity_id: str,
        resource: str,
        within: str,
        interval: Interval,
        duration_s: int,
    ) -> Subscription | None:
        """A new one; ``None`` if there are ``MAX_SUBSCRIPTIONS``."""
        with self._lock:
            self._forget_expired()
            if len(self._known) >= MAX_SUBSCRIPTIONS:
                return None
            self._count += 1
            made = Subscription(
                f"sub_{self._count:03d}",
                collection,
                entity_id,
                resource,
                within,
                interval,
                self._clock.monotonic_ns() + duration_s * 10**9,
            )
            self._known[made.id] = made
            return made

    def of(self, collection: str, entity_id: str) -> list[Subscription]:
        """All of one entity, the oldest first."""
        with self._lock:
            self._forget_expired()
            return [
                one
                for one in self._known.values()
                if (one.collection, one.entity_id) == (collection, entity_id)
            ]

    def get(self, collection: str, entity_id: str, subscription_id: str) -> Subscription | None:
        """One of an entity's, while it lasts."""
        with self._lock:
            self._forget_expired()
            found = self._known.get(subscription_id)
        if found is None or (found.collection, found.entity_id) != (collection, entity_id):
            return None
        return found

    def change(
        self, subscription: Subscription, interval: Interval | None, duration_s: int | None
    ) -> Subscription:
        """Another pace, or to end so long from now; what is ``None`` stays."""
        expires_ns = subscription.expires_ns
        if duration_s is not None:
            expires_ns = self._clock.monotonic_ns() + duration_s * 10**9
        changed = attrs.evolve(
            subscription, interval=interval or subscription.interval, expires_ns=expires_ns
        )
        with self._lock:
            self._known[subscription.id] = changed
        return changed

    def remove(self, subscription: Subscription) -> None:
        """It is no more."""
        with self._lock:
            self._known.pop(subscription.id, None)

    def _forget_expired(self) -> None:
        now_ns = self._clock.monotonic_ns()
        self._known = {key: one for key, one in self._known.items() if one.expires_ns > now_ns}
