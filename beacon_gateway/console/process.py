"""How this process shares its time, so that nobody who asks waits for what others do meanwhile.

Both settings are the whole process's, so only ``beacon run``, whose process it is, makes them.
"""

from __future__ import annotations

import gc
import sys

__all__ = ["keep_answers_prompt"]

_SWITCH_S = 0.0005
"""How long a thread may go on while another one waits for Python's lock. By itself Python waits
5 ms, and whoever is asked gives the lock away with each piece that it sends: a thread that is at
work on a long list would cost each answer several times that."""

_THRESHOLDS = (5_000, 10, 20)
"""When Python looks for objects that only hold each other. By default it does so for each 700 new
ones, and for all there are after a hundred times that: 50 ms for ten thousand hints, which hold
nobody. What is not found for so long is a million objects, some 100 MB."""


def keep_answers_prompt() -> None:
    """To be called once everything is loaded: what is there by now is never looked at again."""
    sys.setswitchinterval(_SWITCH_S)
    gc.set_threshold(*_THRESHOLDS)
    gc.collect()
    gc.freeze()
