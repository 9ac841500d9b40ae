"""Who an end is, for ever and in this life: its origin and its epoch.

Receivers know a forwarder by its *origin*, and its lives by their *epoch*, which must rise with
each start: what a life with a lower epoch says is not believed any more. The wall clock serves, but
it may be set back, as on a board without a battery. So the last epoch is kept in a small file.
"""

from __future__ import annotations

import fcntl
import hashlib
import logging
import os
import platform
import secrets
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from beacon_core.clock import Clock
from beacon_core.errors import ConfigError

__all__ = ["default_state_folder", "new_asker", "next_epoch", "origin_of"]

_log = logging.getLogger(__name__)

_MACHINE_ID = Path("/etc/machine-id")


def origin_of(*parts: str) -> int:
    """63 bits from what this machine is, and what makes the end unique on it.

    Machines that are copies of each other, network interface and all, must be told apart by hand.
    """
    machine = ""
    with suppress(OSError):
        machine = _MACHINE_ID.read_text(encoding="ascii").strip()
    told = "\0".join((platform.node(), machine, str(uuid.getnode()), *parts))
    digest = hashlib.blake2b(told.encode(errors="surrogateescape"), digest_size=8).digest()
    return int.from_bytes(digest, "little") >> 1 or 1


def new_asker() -> int:
    """For one life of a republisher: 63 bits that no other has."""
    return secrets.randbelow(2**63 - 1) + 1


def default_state_folder() -> Path:
    """Where programs of this user keep what they must remember (XDG Base Directory, 0.8)."""
    home = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(home) / "beacon" / "relay"


@contextmanager
def next_epoch(folder: Path, origin: int, clock: Clock) -> Iterator[int]:
    """Within: this life of the origin, which no other process may live at the same time.

    Raises ``ConfigError`` if another does. Where the file cannot be written, the wall clock alone
    must do, and a warning says so.
    """
    path = folder / f"{origin:016x}.epoch"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = path.open("a+b")
    except OSError as error:
        _log.warning(
            "%s cannot be written (%s): a clock that is set back makes others deaf to this relay",
            path,
            error.strerror or error,
        )
        yield clock.wall_ns()
        return
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigError(
                f"origin: {origin:#x} is in use by another process; stop it, or give this end"
                " another origin"
            ) from None
        yield _risen(file, clock.wall_ns())


def _risen(file: BinaryIO, wall_ns: int) -> int:
    file.seek(0)
    epoch = wall_ns
    with suppress(ValueError):
        epoch = max(wall_ns, int(file.read(32)) + 1)
    file.truncate(0)
    file.write(b"%d\n" % epoch)
    file.flush()
    return epoch
