"""The gateway's HTTP interface, an ASGI application to serve or to mount."""

from beacon_gateway.http.app import create_app

__all__ = ["create_app"]
