from __future__ import annotations

import pytest

from beacon_core.clock import ManualClock
from beacon_core.entities import App, Entities, Function
from beacon_core.hint import BeaconHint
from beacon_core.ports.introspection import IntrospectionProvider
from beacon_core.provider import BeaconProvider
from beacon_core.store import HintStore
from beacon_core.testing.examples import BENCH_HINT

SECOND = 10**9


@pytest.fixture
def store() -> HintStore:
    return HintStore(ManualClock(), ttl_s=10, expiry_s=300)


def advance(store: HintStore, seconds: int) -> None:
    assert isinstance(store.clock, ManualClock)
    store.clock.advance(seconds * SECOND)


def test_it_says_what_the_stores_hints_say_about_the_tree(store: HintStore) -> None:
    provider: IntrospectionProvider = BeaconProvider(store)
    known = Entities(apps=[App("a")], functions=[Function("f", "F")])
    store.update(BeaconHint("a", display_name="A", function_ids=("f",)))
    store.update(BeaconHint("u"))
    result = provider.introspect(known)
    assert result.new_apps == (App("a", "A"),)
    assert result.new_functions == (Function("f", "F", ("a",)),)
    assert result.skipped == ("u",)


def test_unknown_entities_become_apps_where_that_is_allowed(store: HintStore) -> None:
    store.update(BeaconHint("u"))
    provider = BeaconProvider(store, allow_new_entities=True)
    assert provider.introspect(Entities()).new_apps == (App("u", source="beacon"),)


def test_a_response_tells_the_age_at_the_moment_it_is_asked_for(store: HintStore) -> None:
    provider = BeaconProvider(store)
    store.update(BENCH_HINT)
    advance(store, 4)
    body = provider.response(BENCH_HINT.entity_id)
    assert body is not None
    assert len(body) == 14
    assert (body["status"], body["age_sec"]) == ("active", 4.0)
    advance(store, 8)
    body = provider.response(BENCH_HINT.entity_id)
    assert body is not None
    assert (body["status"], body["age_sec"]) == ("stale", 12.0)


def test_a_goodbye_still_answers_as_left(store: HintStore) -> None:
    store.update(BeaconHint("a"))
    store.goodbye("a")
    body = BeaconProvider(store).response("a")
    assert body is not None
    assert body["status"] == "left"


def test_there_is_no_response_for_who_was_never_heard_or_has_expired(store: HintStore) -> None:
    provider = BeaconProvider(store)
    assert provider.response("a") is None
    store.update(BeaconHint("a"))
    advance(store, 300)
    assert provider.response("a") is None
