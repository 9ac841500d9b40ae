"""How this process shares its time, so that nobody who asks waits for what others do meanwhile; and
that it ends when it is told to.

The settings are the whole process's, so only commands whose process it is make them.
"""

from __future__ import annotations

import ctypes
import faulthandler
import gc
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["end_watched", "keep_answers_prompt", "keep_memory_together", "memory_given_back"]

_SWITCH_S = 0.0005
"""How long a thread may go on while another one waits for Python's lock. By itself Python waits
5 ms, and whoever is asked gives the lock away with each piece that it sends: a thread that is at
work on a long list would cost each answer several times that."""

_THRESHOLDS = (5_000, 10, 20)
"""When Python looks for objects that only hold each other. By default it does so for each 700 new
ones, and for all there are after a hundred times that: 50 ms for ten thousand hints, which hold
nobody. What is not found for so long is a million objects, some 100 MB."""


_M_ARENA_MAX = -8
"""Of glibc's malloc.h."""

_ARENAS = 2
"""By default glibc has eight for each core, and what one thread gives back to its own no other one
takes: with ROS nodes that come and go what was free and not used came to 16 MB in two minutes, and
to 8 with two."""


def keep_memory_together() -> None:
    """To be called before threads are started. Without glibc it does nothing."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_ARENA_MAX, _ARENAS)


_TRIM_EACH_S = 30.0


@contextmanager
def memory_given_back(each_s: float = _TRIM_EACH_S) -> Iterator[None]:
    """Within: what is free in the heaps is given back to the system now and then.

    glibc gives back only what lies at a heap's end, and something always lies behind. Takes some
    milliseconds, outside of Python's lock. Without glibc it does nothing.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    ended = threading.Event()

    def give_back() -> None:
        while trim is not None and not ended.wait(each_s):
            trim(0)

    thread = threading.Thread(target=give_back, name="beacon-trim", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


_END_WITHIN_S = 15.0
"""Three times what a gateway takes whose adapters and clients all use up their time."""

_STDERR = 2


@contextmanager
def end_watched(within_s: float = _END_WITHIN_S) -> Iterator[Callable[[], None]]:
    """Gives what is to be called when the end begins: it must be over so many seconds later.

    If it is not, where each thread is goes to stderr, and the process ends with 1. A library that
    stands still while it holds Python's lock, as Fast DDS now and then does when a participant
    ends (its issue 6502), can be ended by nothing in Python; faulthandler's thread is none of
    Python's.
    """

    def begins() -> None:
        faulthandler.dump_traceback_later(within_s, exit=True, file=_STDERR)

    try:
        yield begins
    finally:
        faulthandler.cancel_dump_traceback_later()


def keep_answers_prompt() -> None:
    """To be called once everything is loaded: what is there by now is never looked at again."""
    sys.setswitchinterval(_SWITCH_S)
    gc.set_threshold(*_THRESHOLDS)
    gc.collect()
    gc.freeze()
