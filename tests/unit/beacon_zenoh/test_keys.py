"""Keys: who speaks on one, whose token it is, and what is neither."""

from __future__ import annotations

import pytest
import zenoh
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.testing.strategies import ids
from beacon_zenoh.keys import Keys, Token

KEYS = Keys("fleet/beacon")


@settings(deadline=None)
@given(ids())
def test_an_entity_is_found_in_its_own_key(entity_id: str) -> None:
    assert KEYS.entity_of(KEYS.hint(entity_id)) == entity_id
    assert zenoh.KeyExpr(KEYS.hints).includes(KEYS.hint(entity_id))


@settings(deadline=None)
@given(ids(), st.sampled_from(["", "0123456789abcdef", "i" * 64]))
def test_a_token_is_found_in_its_own_key(entity_id: str, incarnation: str) -> None:
    token = Token(entity_id, incarnation)
    assert KEYS.token_of(KEYS.token(token)) == token
    assert zenoh.KeyExpr(KEYS.tokens).includes(KEYS.token(token))


def test_the_keys_are_the_documented_ones() -> None:
    keys = Keys("beacon")
    assert keys.hint("engine") == "beacon/hint/engine"
    assert keys.token(Token("engine")) == "beacon/live/engine"
    assert keys.token(Token("engine", "run")) == "beacon/live/engine/run"


@pytest.mark.parametrize(
    "key",
    [
        "fleet/**",
        "**",
        "fleet/beacon/hint/",
        "fleet/beacon/hint/" + "e" * 257,
        "beacon/hint/engine",
    ],
)
def test_nobody_speaks_on_other_keys(key: str) -> None:
    assert KEYS.entity_of(key) == ""


@pytest.mark.parametrize(
    "key",
    [
        "**",
        "fleet/beacon/hint/engine",
        "fleet/beacon/live/",
        "fleet/beacon/live/not an id",
        "fleet/beacon/live/*",
        "fleet/beacon/live/engine/",
        "fleet/beacon/live/engine/run/more",
        "fleet/beacon/live/engine/" + "i" * 65,
    ],
)
def test_other_tokens_are_nobodys(key: str) -> None:
    assert KEYS.token_of(key) is None


@settings(deadline=None)
@given(st.text(max_size=50))
def test_any_text_gives_an_answer(text: str) -> None:
    assert KEYS.entity_of(f"fleet/beacon/hint/{text}") == text
    token = KEYS.token_of(f"fleet/beacon/live/{text}")
    assert token is None or KEYS.token(token) == f"fleet/beacon/live/{text}"
