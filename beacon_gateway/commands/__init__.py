"""The subcommands of ``beacon``, one module each: ``parser()`` and ``run(arguments)``."""

from __future__ import annotations

__all__: list[str] = []
