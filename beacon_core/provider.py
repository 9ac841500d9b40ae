"""A store's answers to a gateway: the core, ready to be embedded."""

from __future__ import annotations

from beacon_core.entities import Entities
from beacon_core.introspection import Introspection
from beacon_core.mapper import IncrementalMapper
from beacon_core.response import build_response
from beacon_core.store import HintStore

__all__ = ["BeaconProvider"]


class BeaconProvider:
    """Implements :class:`beacon_core.ports.introspection.IntrospectionProvider` over one store.

    ``allow_new_entities``: a hint about nobody known makes an app of source ``beacon``; otherwise
    it is skipped.

    Thread rule: any thread.
    """

    def __init__(self, store: HintStore, *, allow_new_entities: bool = False) -> None:
        self._store = store
        self._mapper = IncrementalMapper(store, allow_new_entities=allow_new_entities)

    def introspect(self, entities: Entities) -> Introspection:
        """See :meth:`beacon_core.mapper.IncrementalMapper.introspect`."""
        return self._mapper.introspect(entities)

    def response(self, entity_id: str) -> dict[str, object] | None:
        """See :func:`beacon_core.response.build_response`; ``None`` for an id without a hint."""
        stored = self._store.get(entity_id)
        if stored is None:
            return None
        return build_response(stored, self._store.clock.monotonic_ns())
