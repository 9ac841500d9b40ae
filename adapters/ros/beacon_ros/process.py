"""Who this process is, for hints that do not say."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

import attrs

from beacon_core.hint import BeaconHint

__all__ = ["identified"]


def identified(hint: BeaconHint) -> BeaconHint:
    """The hint with process id, process name and hostname of this process where it gives none."""
    return attrs.evolve(
        hint,
        process_id=hint.process_id or os.getpid(),
        process_name=hint.process_name or Path(*sys.argv[:1]).name,
        hostname=hint.hostname or socket.gethostname(),
    )
