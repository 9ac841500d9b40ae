"""The port is enough: a gateway that knows nothing else takes any provider."""

from __future__ import annotations

from beacon_core.entities import App, Entities
from beacon_core.introspection import BeaconMetadata, Introspection
from beacon_core.ports.introspection import IntrospectionProvider


class Fixed:
    """The smallest provider: it always says the same."""

    def introspect(self, entities: Entities) -> Introspection:
        apps = tuple(App(app_id, "Said by me") for app_id in entities.apps)
        return Introspection(1, apps, (), (), BeaconMetadata({}, 0))

    def response(self, entity_id: str) -> dict[str, object] | None:
        return {"entity_id": entity_id} if entity_id == "a" else None


def names(provider: IntrospectionProvider, entities: Entities) -> dict[str, str]:
    """All that a gateway needs in order to show what hints add."""
    shadows = {shadow.id: shadow.name for shadow in provider.introspect(entities).new_apps}
    return {app.id: shadows.get(app.id) or app.name for app in entities.apps.values()}


def test_a_gateway_needs_nothing_but_the_port() -> None:
    assert names(Fixed(), Entities(apps=[App("a", "Known")])) == {"a": "Said by me"}


def test_somebody_elses_class_is_a_provider_without_inheriting() -> None:
    provider: IntrospectionProvider = Fixed()
    assert provider.response("a") == {"entity_id": "a"}
    assert provider.response("b") is None
    assert set(vars(IntrospectionProvider)) >= {"introspect", "response"}
