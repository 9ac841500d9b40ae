"""How the ``beacon`` command ends: exit codes, and the exception that carries one."""

from __future__ import annotations

import enum

__all__ = ["EXIT_CODES", "Exit", "Fault"]


class Exit(enum.IntEnum):
    """The exit codes; ``EXIT_CODES`` says when each is used."""

    OK = 0
    FAILED = 1
    USAGE = 2
    NOT_FOUND = 3
    INTERRUPTED = 130


EXIT_CODES = """\
exit codes:
  0    done; also after Ctrl-C or SIGTERM, for commands that run until stopped
  1    failed while running: no gateway answers, the port is in use, ...
  2    wrong usage or configuration; nothing was started
  3    not found: no such entity, or it has no beacon (any more)
  130  stopped with Ctrl-C before it was done
"""
"""For ``--help``."""


class Fault(Exception):  # noqa: N818 - it is the user's message, not a programming error
    """Ends the command with a message on stderr and an exit code."""

    def __init__(self, message: str, code: Exit = Exit.FAILED) -> None:
        super().__init__(message)
        self.code = code
