"""A file with what the gateway knows, so that after a restart it shows the last known hints.

Lines of JSON: a head, one line per hint, and an end that counts them, so a file that was cut off is
recognised. It is written beside its place, flushed to the disk and then renamed, so there is always
a whole one. What is read back is STALE until it is heard, as old as it is; see
:meth:`beacon_core.store.HintStore.restore`. A file that cannot be understood is set aside and said:
a gateway without its past is better than none.
"""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs
import cattrs
import orjson

from beacon_core.clock import Clock
from beacon_core.hint import BeaconHint
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint
from beacon_core.validator import Rejected, validate

__all__ = ["DamagedError", "SnapshotConfig", "SnapshotFile", "Snapshots"]

_log = logging.getLogger(__name__)

_FORMAT, _VERSION = "beacon-snapshot", 1

_MAX_LINE = 4 * 1024 * 1024
"""Bytes of one line: a hint at every limit has far less, and a foreign file is not read whole."""

_FSYNC_FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0)


@attrs.frozen
class SnapshotConfig:
    """Where, and how often."""

    path: Path
    every_s: float = attrs.field(default=30.0, metadata={"at_least": 1.0})


class DamagedError(ValueError):
    """The file is not one of ours, or not whole."""


@attrs.frozen
class _Known:
    """One line: a hint as a store knew it."""

    store: str
    hint: BeaconHint
    age_ns: int
    source: str
    incarnation: str
    restarts: int

    @classmethod
    def of(cls, store: str, stored: StoredHint, now_ns: int) -> _Known:
        age_ns = stored.age_ns(now_ns)
        who = (stored.source, stored.incarnation, stored.restarts)
        return cls(store, stored.hint, age_ns, *who)


class SnapshotFile:
    """Thread rule: one thread at a time."""

    def __init__(self, path: Path, clock: Clock) -> None:
        self._path, self._clock = path, clock
        self._converter = cattrs.Converter(forbid_extra_keys=True)

    def write(self, stores: Mapping[str, HintStore]) -> int:
        """Write what the stores know; returns how many hints. Raises ``OSError``."""
        beside = self._path.with_name(self._path.name + ".tmp")
        count = 0
        # Host names and how a robot is built are nobody else's business.
        with open(beside, "wb", opener=_private) as file:
            for line in self._lines(stores):
                file.write(orjson.dumps(line) + b"\n")
                count += 1
            file.flush()
            os.fsync(file.fileno())
        beside.replace(self._path)
        _sync_folder(self._path.parent)
        return count - 2

    def restore(self, stores: Mapping[str, HintStore]) -> int:
        """Bring back what the file has of these stores; returns how many hints.

        Never raises: a file that cannot be understood is set aside, as ``.damaged``.
        """
        try:
            known = self._read()
        except FileNotFoundError:
            return 0
        except OSError as error:
            _log.warning("%s: cannot be read: %s", self._path, error.strerror or error)
            return 0
        except Exception as error:  # noqa: BLE001 - whatever a foreign file makes of a parser
            self._set_aside(error)
            return 0
        now_ns = self._clock.monotonic_ns()
        # The one heard last is the one changed last.
        known.sort(key=lambda one: one.age_ns, reverse=True)
        return sum(
            one.store in stores and _restored(stores[one.store], one, now_ns) for one in known
        )

    def _lines(self, stores: Mapping[str, HintStore]) -> Iterator[dict[str, Any]]:
        yield {"format": _FORMAT, "version": _VERSION, "written_at_ns": self._clock.wall_ns()}
        count = 0
        for name, store in stores.items():
            for stored in store.snapshot():
                now_ns = self._clock.monotonic_ns()
                yield self._converter.unstructure(_Known.of(name, stored, now_ns))
                count += 1
        yield {"end": count}

    def _read(self) -> list[_Known]:
        with self._path.open("rb") as file:
            lines = _whole_lines(file)
            head = orjson.loads(next(lines, b""))
            if head["format"] != _FORMAT or head["version"] != _VERSION:
                raise DamagedError("another format")
            # A clock that was set back must not make anything younger.
            passed_ns = max(0, self._clock.wall_ns() - int(head["written_at_ns"]))
            known: list[_Known] = []
            for line in lines:
                found = orjson.loads(line)
                if "end" in found:
                    if found["end"] != len(known) or next(lines, None) is not None:
                        raise DamagedError("its end does not fit")
                    return known
                known.append(self._understood(found, passed_ns))
        raise DamagedError("it has no end")

    def _understood(self, line: object, passed_ns: int) -> _Known:
        one = self._converter.structure(line, _Known)
        checked = validate(one.hint)
        if isinstance(checked, Rejected) or one.age_ns < 0:
            raise DamagedError("a hint that cannot be one")
        return attrs.evolve(one, hint=checked.hint, age_ns=one.age_ns + passed_ns)

    def _set_aside(self, error: Exception) -> None:
        aside = self._path.with_name(self._path.name + ".damaged")
        reason = str(error).partition("\n")[0] or type(error).__name__
        try:
            self._path.replace(aside)
        except OSError as failure:
            _log.warning("%s: damaged (%s), and stays: %s", self._path, reason, failure.strerror)
            return
        _log.warning("%s: damaged (%s); set aside as %s", self._path, reason, aside.name)


class Snapshots:
    """Keeps the file up to date, in a thread of its own.

    Thread rule: ``restore``, ``start``, ``close`` from one thread.
    """

    def __init__(
        self, config: SnapshotConfig, stores: Mapping[str, HintStore], clock: Clock
    ) -> None:
        self._file = SnapshotFile(config.path, clock)
        self._path, self._every_s, self._stores = config.path, config.every_s, stores
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="beacon-snapshot", daemon=True)
        self._failing = False

    def restore(self) -> None:
        """Bring back what is known from before."""
        count = self._file.restore(self._stores)
        if count:
            _log.info("%s: %d hints known from before", self._path, count)

    def start(self) -> None:
        """Begin to write, now and then."""
        self._thread.start()

    def close(self, within_s: float) -> None:
        """Write once more, and stop. Idempotent."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join(within_s)

    def _run(self) -> None:
        while not self._closing.wait(self._every_s):
            self._write()
        self._write()

    def _write(self) -> None:
        try:
            self._file.write(self._stores)
        except OSError as error:
            if not self._failing:
                _log.error("%s: cannot be written: %s", self._path, error.strerror or error)
            self._failing = True
        else:
            self._failing = False


def _restored(store: HintStore, known: _Known, now_ns: int) -> bool:
    verdict = store.restore(
        known.hint,
        last_seen_ns=now_ns - known.age_ns,
        source=known.source,
        incarnation=known.incarnation,
        restarts=known.restarts,
    )
    return verdict is Verdict.NEW


def _whole_lines(file: Any) -> Iterator[bytes]:
    while line := file.readline(_MAX_LINE):
        if not line.endswith(b"\n"):
            raise DamagedError("a line without an end")
        yield line


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _sync_folder(folder: Path) -> None:
    opened = os.open(folder, _FSYNC_FOLDER)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)
