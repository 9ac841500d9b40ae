"""The key expressions of the native dialect.

=====================================  ==========================================================
``<prefix>/hint/<entity_id>``          PUT: the hint as JSON; DELETE: its goodbye. A queryable
                                       there answers with the present hint.
``<prefix>/live/<entity_id>[/<run>]``  a liveliness token that lives as long as the announcer's
                                       connection; ``<run>`` is its incarnation
=====================================  ==========================================================

With the incarnation in its key, a token that goes tells *whose* it was: the death of a predecessor
cannot be taken for the death of the successor under the same id. (Zenoh counts equal tokens of
several sessions as one, and reports only the end of the last.) Without it, it stands for whoever
speaks under the id.
"""

from __future__ import annotations

import attrs

from beacon_core.limits import DEFAULT_LIMITS
from beacon_core.validator import is_valid_id
from beacon_zenoh.wire import MAX_INCARNATION_LENGTH

__all__ = ["Keys", "Token"]


@attrs.frozen
class Token:
    """Somebody who is there: an entity, and which run of its announcer."""

    entity_id: str
    incarnation: str = ""


class Keys:
    """All keys under one prefix. Thread rule: immutable."""

    def __init__(self, prefix: str) -> None:
        self._hint = f"{prefix}/hint/"
        self._live = f"{prefix}/live/"
        self.hints = f"{self._hint}*"
        """Matches every hint. One chunk only: an id has no ``/``."""
        self.tokens = f"{self._live}**"
        self._start = len(self._hint)
        self._longest = self._start + DEFAULT_LIMITS.max_id_length

    def hint(self, entity_id: str) -> str:
        """Where the hints of this entity belong."""
        return self._hint + entity_id

    def token(self, token: Token) -> str:
        """The key of a liveliness token."""
        run = f"/{token.incarnation}" if token.incarnation else ""
        return f"{self._live}{token.entity_id}{run}"

    def entity_of(self, key: str) -> str:
        """Who may speak on this key; ``""`` if it is not the key of one entity.

        A key may hold wildcards, and then be anything that matches. What is left after the prefix
        need not be a valid id: no valid hint goes with it then.
        """
        if len(key) <= self._longest and key.startswith(self._hint):
            return key[self._start :]
        return ""

    def token_of(self, key: str) -> Token | None:
        """Whose token it is; ``None`` if it is not one of ours."""
        if not key.startswith(self._live):
            return None
        entity_id, slash, incarnation = key[len(self._live) :].partition("/")
        if not is_valid_id(entity_id) or bool(slash) != bool(incarnation):
            return None
        if "/" in incarnation or len(incarnation) > MAX_INCARNATION_LENGTH:
            return None
        return Token(entity_id, incarnation)
