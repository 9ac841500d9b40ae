"""What machines watch the gateway by: metrics, and whether it lives and is ready."""

from beacon_gateway.metrics.routes import routes

__all__ = ["routes"]
