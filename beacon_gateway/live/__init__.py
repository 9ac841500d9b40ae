"""The live view: what happens to whom, as it happens."""

from beacon_gateway.live.routes import routes

__all__ = ["routes"]
