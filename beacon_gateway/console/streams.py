"""Standard output belongs to the data."""

from __future__ import annotations

import os
import sys

__all__ = ["keep_stdout_for_data"]


def keep_stdout_for_data() -> None:
    """From now on what native libraries write to stdout goes to stderr.

    Fast DDS complains on file descriptor 1, in the midst of what a script reads. Python's stdout
    keeps where it writes to, under another number. For the process's own start, once.
    """
    encoding, tty = sys.stdout.encoding, sys.stdout.isatty()
    sys.stdout.flush()
    ours = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = os.fdopen(ours, "w", encoding=encoding, buffering=1 if tty else -1)
