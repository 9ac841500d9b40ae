"""A running gateway, asked over HTTP."""

from __future__ import annotations

import os
from typing import Any, Self
from urllib.parse import quote

import attrs
import httpx

from beacon_gateway.console.exits import Exit, Fault
from beacon_gateway.tree.host import HOST

__all__ = ["DEFAULT_URL", "TOKEN_VARIABLE", "Absent", "Answer", "GatewayClient", "Unreachable"]

DEFAULT_URL = "http://127.0.0.1:8080"
"""Where ``beacon run`` listens unless told otherwise."""

_API_BASE = "/api/v1"

TOKEN_VARIABLE = "BEACON_TOKEN"  # noqa: S105 - its name
"""The environment's variable with the token to show; an argument would be seen by everybody."""

_TIMEOUT_S = 5.0

_REFUSED = (401, 403)


class Unreachable(Fault):
    """Nobody answers, or somebody who is no gateway."""


class Absent(Unreachable):
    """There is nobody at that address."""


@attrs.frozen
class Answer:
    """One answer; an error answer too is an answer."""

    status: int
    body: dict[str, Any]

    @property
    def ok(self) -> bool:
        return self.status == httpx.codes.OK

    @property
    def code(self) -> str:
        """The error's code: the vendor's own where there is one."""
        return str(self.body.get("vendor_code") or self.body.get("error_code") or "")


class GatewayClient:
    """Thread rule: one thread. Use it as a context manager."""

    def __init__(self, url: str = DEFAULT_URL) -> None:
        """``url`` as printed by ``beacon run``; the scheme and the API's path may be left out."""
        self.url = _base(url)
        try:
            token = os.environ.get(TOKEN_VARIABLE, "")
            headers = {"authorization": f"Bearer {token}"} if token else {}
            self._client = httpx.Client(
                base_url=self.url + _API_BASE, timeout=_TIMEOUT_S, headers=headers
            )
        except (httpx.InvalidURL, ValueError) as error:
            raise Fault(f"--url {url}: not an address: {error}", Exit.USAGE) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.close()

    def get(self, path: str) -> Answer:
        """Raises :class:`Unreachable` with a sentence that says what to do."""
        try:
            response = self._client.get(path)
        except httpx.TimeoutException as error:
            raise Unreachable(
                f"the gateway at {self.url} did not answer within {_TIMEOUT_S:.0f} s"
            ) from error
        except (httpx.TransportError, httpx.InvalidURL) as error:
            raise Absent(
                f"no gateway answers at {self.url}; "
                "start one with 'beacon run', or name another with --url"
            ) from error
        if response.status_code in _REFUSED:
            raise Unreachable(
                f"the gateway at {self.url} wants a token that may read (HTTP "
                f"{response.status_code}); put it into the variable {TOKEN_VARIABLE}"
            )
        try:
            body = response.json()
        except ValueError as error:
            raise self._stranger(response) from error
        if not isinstance(body, dict):
            raise self._stranger(response)
        return Answer(response.status_code, body)

    def entities(self) -> list[dict[str, Any]]:
        """All apps and components, as the gateway lists them; but not its own place for apps that
        nobody places, which is nobody to watch."""
        found: list[dict[str, Any]] = []
        for path in ("/apps", "/components"):
            answer = self.get(path)
            if not answer.ok:
                raise Unreachable(f"{self.url} answered {answer.status} for {_API_BASE}{path}")
            found += answer.body.get("items", [])
        return [item for item in found if item.get("x-medkit", {}).get("source") != HOST]

    def beacon(self, entity_id: str) -> Answer:
        """The vendor endpoint's answer for an app, or for a component of that id."""
        safe_id = quote(entity_id, safe="")
        answer = self.get(f"/apps/{safe_id}/x-medkit-beacon")
        if answer.code == "invalid-parameter" and "is a Component" in answer.body.get(
            "message", ""
        ):
            return self.get(f"/components/{safe_id}/x-medkit-beacon")
        return answer

    def _stranger(self, response: httpx.Response) -> Unreachable:
        return Unreachable(
            f"what answers at {self.url} is no beacon gateway (HTTP {response.status_code}, "
            "no JSON); name the right address with --url"
        )


def _base(url: str) -> str:
    with_scheme = url if "://" in url else f"http://{url}"
    return with_scheme.rstrip("/").removesuffix(_API_BASE)
