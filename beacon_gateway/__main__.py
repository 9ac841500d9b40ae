"""``python -m beacon_gateway`` is the ``beacon`` command."""

from __future__ import annotations

import sys

from beacon_gateway.cli import main

sys.exit(main())
