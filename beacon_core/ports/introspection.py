"""What a gateway asks of whoever knows about its entities."""

from __future__ import annotations

from typing import Protocol

from beacon_core.entities import Entities
from beacon_core.introspection import Introspection

__all__ = ["IntrospectionProvider"]


class IntrospectionProvider(Protocol):
    """The one face a gateway sees; :class:`beacon_core.provider.BeaconProvider` is ours.

    Thread rule: both methods may be called from any thread, also several at once. Neither waits
    for the network, calls back or raises.
    """

    def introspect(self, entities: Entities) -> Introspection:
        """What is said about the known tree at this moment.

        The cheaper, the less has changed since the last call: best called with the same
        ``entities`` object for as long as the tree is the same.
        """

    def response(self, entity_id: str) -> dict[str, object] | None:
        """The vendor endpoint's body for one entity, ``None`` if nothing is known of it.

        It does not depend on the tree: whether the entity exists is the gateway's to say.
        """
