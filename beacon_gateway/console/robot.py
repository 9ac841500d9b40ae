"""One simulated robot of ``beacon demo``: a process of its own, so that it can really be killed.

It reads one line of JSON from stdin (options of the zenoh adapter, and hints), announces, and says
goodbye when stdin ends. So it also ends in order if the demo itself is killed.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from contextlib import closing
from typing import Any

import attrs

from beacon_core.hint import BeaconHint
from beacon_gateway.adapters import load_adapter
from beacon_gateway.structuring import Structurer

__all__ = ["main"]

_PERIOD_S = 1.0


def main() -> None:
    """Announce until stdin ends."""
    # Ctrl-C reaches the whole terminal; the demo decides what becomes of its robots.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    order: dict[str, Any] = json.loads(sys.stdin.readline())
    adapter = load_adapter("zenoh")
    options = Structurer().structure(order["options"], adapter.options)
    with closing(adapter.announcer(options, _PERIOD_S)) as announcer:
        for hint in Structurer().structure(order["hints"], list[BeaconHint]):
            announcer.announce(attrs.evolve(hint, process_id=os.getpid()))
        sys.stdin.read()


if __name__ == "__main__":
    main()
