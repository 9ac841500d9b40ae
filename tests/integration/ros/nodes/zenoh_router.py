"""A Zenoh router at the endpoint that is given, until it is ended."""

from __future__ import annotations

import json
import signal
import sys

import zenoh

SETTINGS = {
    "mode": "router",
    "listen": {"endpoints": [sys.argv[1]]},
    "scouting": {"multicast": {"enabled": False}},
}

with zenoh.open(zenoh.Config.from_json5(json.dumps(SETTINGS))):
    print(json.dumps({"up": True}), flush=True)  # noqa: T201 - read by who started it
    signal.sigwait({signal.SIGINT, signal.SIGTERM})
