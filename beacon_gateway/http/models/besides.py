"""Bodies of what the gateway serves besides the contract: the live view and tokens."""

from __future__ import annotations

from collections.abc import Sequence

import attrs

from beacon_gateway.http.models.base import Open, key

__all__ = ["BeaconChanges", "OAuthError", "Probe", "Revocation", "TokenRequest", "Tokens"]


@attrs.frozen(kw_only=True)
class BeaconChanges:
    """Rows of the live view: all, or those that have changed since a revision."""

    revision: str
    timestamp: str
    complete: bool
    items: Sequence[Open]
    gone: Sequence[str]
    x_medkit: Open = key("x-medkit")


@attrs.frozen(kw_only=True)
class Probe:
    """Yes, or why not."""

    status: str
    reasons: Sequence[str] | None = None


@attrs.frozen(kw_only=True)
class TokenRequest:
    """What a client gives for a token (RFC 6749, 4.4 and 6; RFC 7009)."""

    grant_type: str | None = None
    client_id: str | None = None
    client_secret: str | None = None
    refresh_token: str | None = None
    token: str | None = None


@attrs.frozen(kw_only=True)
class Tokens:
    """An access token, and another to get the next one with."""

    access_token: str
    token_type: str
    expires_in: int
    scope: str
    refresh_token: str


@attrs.frozen(kw_only=True)
class Revocation:
    """The token opens nothing any more, if it ever did."""

    status: str


@attrs.frozen(kw_only=True)
class OAuthError:
    """A refusal in OAuth's form."""

    error: str
    error_description: str
