"""A ready gateway around the core: configuration, sources, HTTP and the ``beacon`` command."""

from __future__ import annotations

from importlib.metadata import version

__all__ = ["__version__"]

__version__ = version("beacon-core")
