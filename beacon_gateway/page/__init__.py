"""The page that people look at."""

from beacon_gateway.page.routes import routes

__all__ = ["routes"]
