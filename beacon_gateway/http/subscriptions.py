"""Cyclic subscriptions on what beacons say, over server-sent events."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Callable, Iterator, Mapping
from typing import Any

import attrs
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute

from beacon_gateway.gateway import Gateway
from beacon_gateway.http import errors
from beacon_gateway.http.answers import answer
from beacon_gateway.http.beacon_bodies import iso
from beacon_gateway.http.lookup import COLLECTIONS, named
from beacon_gateway.http.models.base import as_plain
from beacon_gateway.http.models.subscriptions import (
    CyclicSubscription,
    CyclicSubscriptionCreateRequest,
    CyclicSubscriptionList,
    CyclicSubscriptionUpdateRequest,
    Interval,
)
from beacon_gateway.http.observed import resource_within, sample
from beacon_gateway.http.operations import ApiRoute, Asked, Operation, ask, route
from beacon_gateway.http.requests import body_of, duration_of, interval_of, text_of
from beacon_gateway.http.sse import EventResponse, Places, event, pause
from beacon_gateway.http.subscription_book import (
    MAX_SUBSCRIPTIONS,
    Subscription,
    SubscriptionBook,
)
from beacon_gateway.tree.entities import App, Component, Entity, Function

__all__ = ["MAX_STREAMS", "routes"]

MAX_STREAMS = 200
"""Two for each subscription there can be."""

_SECONDS: Mapping[Interval, float] = {
    Interval.FAST: 0.05,
    Interval.NORMAL: 0.2,
    Interval.SLOW: 0.5,
}


def routes(gateway: Gateway) -> list[BaseRoute]:
    """The same for apps, components and functions; areas have none."""
    book, places = SubscriptionBook(gateway.clock), Places(MAX_STREAMS)
    return [
        one
        for cls in (App, Component, Function)
        for one in _Family(gateway, cls, book, places).routes()
    ]


class _Family:
    """The subscriptions of one kind of entity."""

    def __init__(
        self, gateway: Gateway, cls: type[Entity], book: SubscriptionBook, places: Places
    ) -> None:
        self._gateway = gateway
        self._cls = cls
        self._book = book
        self._places = places

    def routes(self) -> Iterator[BaseRoute]:
        made, one = self._operation, "/{subscription_id}"
        changed = {"request": CyclicSubscriptionUpdateRequest, "method": "PUT"}
        created = {
            "request": CyclicSubscriptionCreateRequest,
            "method": "POST",
            "status": 201,
            "refusals": (413, 503),
        }
        yield route(
            self._gateway,
            made("list{}Subscriptions", "", "Those of one entity", CyclicSubscriptionList),
            self._list,
        )
        yield self._with_body(
            made("create{}Subscription", "", "Begin one", CyclicSubscription, **created),
            self._create,
        )
        yield route(
            self._gateway,
            made("get{}Subscription", one, "One of them", CyclicSubscription),
            self._get,
        )
        yield self._with_body(
            made("update{}Subscription", one, "Change one", CyclicSubscription, **changed),
            self._update,
        )
        yield self._plain(
            made("delete{}Subscription", one, "End one", None, method="DELETE", status=204),
            self._delete,
        )
        yield self._plain(
            made(
                "stream{}SubscriptionEvents",
                f"{one}/events",
                "The resource, again and again",
                None,
                streams=True,
                refusals=(503,),
            ),
            self._events,
        )

    def _operation(
        self, name: str, path: str, summary: str, body: type | None, **more: Any
    ) -> Operation:
        kind = self._cls.__name__
        return Operation(
            id=name.format(kind),
            tag="Subscriptions",
            path=f"/{COLLECTIONS[self._cls]}/{{{kind.lower()}_id}}/cyclic-subscriptions{path}",
            summary=summary,
            body=body,
            **more,
        )

    def _plain(self, operation: Operation, handler: Callable[[Asked], Response]) -> BaseRoute:
        async def serve(request: Request) -> Response:
            return handler(ask(self._gateway, operation, request))

        return ApiRoute(operation, serve)

    def _with_body(
        self, operation: Operation, handler: Callable[[Asked, Mapping[str, Any]], object]
    ) -> BaseRoute:
        async def serve(request: Request) -> Response:
            asked = ask(self._gateway, operation, request)
            named(asked, self._cls)
            return answer(handler(asked, await body_of(request)), operation.status)

        return ApiRoute(operation, serve)

    def _list(self, asked: Asked) -> CyclicSubscriptionList:
        entity = named(asked, self._cls)
        found = self._book.of(COLLECTIONS[self._cls], entity.id)
        return CyclicSubscriptionList(items=[self._body(asked, one) for one in found])

    def _create(self, asked: Asked, given: Mapping[str, Any]) -> CyclicSubscription:
        resource = text_of(given, "resource")
        protocol = text_of(given, "protocol", "sse")
        if protocol != "sse":
            raise errors.ApiError(
                400,
                "x-medkit-unsupported-protocol",
                "Protocol is not available; give 'sse'",
                {"parameter": "protocol", "value": protocol[:256]},
            )
        interval, duration_s = interval_of(given), duration_of(given)
        within = resource_within(asked, self._cls, resource)
        made = self._book.add(
            COLLECTIONS[self._cls], asked.id, resource, within, interval, duration_s
        )
        if made is None:
            raise errors.unavailable(
                f"There are {MAX_SUBSCRIPTIONS} subscriptions already; try again later",
                max_subscriptions=MAX_SUBSCRIPTIONS,
            )
        return self._body(asked, made)

    def _get(self, asked: Asked) -> CyclicSubscription:
        return self._body(asked, self._named(asked))

    def _update(self, asked: Asked, given: Mapping[str, Any]) -> CyclicSubscription:
        interval = interval_of(given) if given.get("interval") is not None else None
        duration_s = duration_of(given) if given.get("duration") is not None else None
        return self._body(asked, self._book.change(self._named(asked), interval, duration_s))

    def _delete(self, asked: Asked) -> Response:
        self._book.remove(self._named(asked))
        return Response(status_code=204)

    def _events(self, asked: Asked) -> Response:
        self._named(asked)
        return EventResponse(self._pieces(asked), self._places)

    async def _pieces(self, asked: Asked) -> AsyncGenerator[bytes, None]:
        stopping = self._gateway.stopping
        while not stopping.is_set() and (subscription := self._find(asked)) is not None:
            yield event(self._sampled(attrs.evolve(asked), subscription))
            await pause(stopping, _SECONDS[subscription.interval])

    def _sampled(self, asked: Asked, subscription: Subscription) -> dict[str, object]:
        sent: dict[str, object] = {"timestamp": iso(self._gateway.clock.wall_ns())}
        try:
            sent["payload"] = as_plain(sample(asked, self._cls, subscription.within))
        except errors.ApiError as error:
            sent["error"] = error.body()
        return sent

    def _named(self, asked: Asked) -> Subscription:
        named(asked, self._cls)
        found = self._find(asked)
        if found is None:
            raise errors.no_such_resource(
                "Subscription not found", subscription_id=asked.params["subscription_id"][:256]
            )
        return found

    def _find(self, asked: Asked) -> Subscription | None:
        collection, subscription_id = COLLECTIONS[self._cls], asked.params["subscription_id"]
        return self._book.get(collection, asked.id, subscription_id)

    def _body(self, asked: Asked, one: Subscription) -> CyclicSubscription:
        href = f"{asked.base}/{one.collection}/{one.entity_id}/cyclic-subscriptions/{one.id}"
        return CyclicSubscription(
            id=one.id,
            observed_resource=one.resource,
            event_source=f"{href}/events",
            protocol="sse",
            interval=one.interval,
        )
