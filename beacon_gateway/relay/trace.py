"""What the cores were told and what they answered, in a file; and the same again from there.

A core does the same whenever it is told the same: it has no clock, no chance and no threads. So a
trace that holds what made it and all that it was told, can be replayed anywhere, exactly: to see
why something was done, and whether a change of the code does it differently.

One line of JSON each: what a core was made of, then one call after the other. Bytes are base64. Of
what was answered only a digest is kept: the replay answers again.
"""

from __future__ import annotations

import base64
import hashlib
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

import attrs
import cattrs

from beacon_core.errors import ConfigError
from beacon_core.relay.effects import Effect
from beacon_core.relay.forwarding import SeenTopic
from beacon_gateway.relay.births import Birth, ForwarderBirth, RepublisherBirth

__all__ = ["CORES", "CoreTrace", "Step", "TraceFile", "replay"]

CORES = ("forwarder", "republisher")
"""The two kinds of core, as they are named in a trace."""

_CALLS = frozenset(
    {
        "frame",
        "link_down",
        "link_up",
        "matched",
        "message",
        "publisher_failed",
        "tick",
        "topic_gone",
        "topic_seen",
    }
)
"""All that a core is told."""

_BIRTHS: dict[str, type[Birth]] = {"forwarder": ForwarderBirth, "republisher": RepublisherBirth}


@attrs.frozen
class Step:
    """One call, replayed."""

    line: int
    end: str
    core: str
    at_ns: int
    method: str
    args: tuple[Any, ...]
    named: dict[str, Any]
    effects: tuple[Effect, ...]
    """What is answered now."""
    alike: bool
    """What was answered then, is the same."""


class TraceFile:
    """Thread rule: any thread; a context manager, which closes the file."""

    def __init__(self, path: Path) -> None:
        """Raises ``ConfigError`` if the file cannot be written. One that is there is replaced."""
        try:
            self._file = path.open("w", encoding="ascii")
        except OSError as error:
            raise ConfigError(f"{path}: {error.strerror or error}") from error
        self._lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._file.close()

    def of(self, end: str, births: tuple[Birth | None, Birth | None]) -> CoreTrace:
        """What an end writes to: a line for each of its cores now, one for each call later."""
        for core, birth in zip(CORES, births, strict=True):
            if birth is not None:
                self.add({"end": end, "core": core, "birth": _converter.unstructure(birth)})
        return CoreTrace(self, end)

    def add(self, line: dict[str, Any]) -> None:
        """One line; nothing, once it is closed."""
        text = json.dumps(line, separators=(",", ":"))
        with self._lock:
            if not self._file.closed:
                self._file.write(text + "\n")


class CoreTrace:
    """The calls of one end. Thread rule: one at a time."""

    def __init__(self, file: TraceFile, end: str) -> None:
        self._file, self._end = file, end

    def write(
        self,
        one: int,
        method: str,
        args: tuple[Any, ...],
        named: dict[str, Any],
        now_ns: int,
        effects: list[Effect],
    ) -> None:
        """What a core was told and what it answered; ``one``: its place in :data:`CORES`."""
        self._file.add(
            {
                "end": self._end,
                "core": CORES[one],
                "at": now_ns,
                "call": method,
                "args": [_plain(arg) for arg in args],
                "named": named,
                "answer": _digest(effects),
            }
        )


def replay(path: Path) -> Iterator[Step]:
    """Each call once more, in a new core. Raises ``ConfigError`` for a file that is no trace."""
    cores: dict[tuple[str, str], Any] = {}
    try:
        with path.open(encoding="ascii") as file:
            for number, text in enumerate(file, 1):
                line = json.loads(text)
                key = line["end"], line["core"]
                if "birth" in line:
                    cores[key] = _converter.structure(line["birth"], _BIRTHS[key[1]]).make()
                else:
                    yield _step(number, line, cores[key])
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from error
    except (ValueError, LookupError, TypeError, cattrs.BaseValidationError) as error:
        raise ConfigError(f"{path}: not a relay's trace, or cut short: {error}") from error


def _step(number: int, line: dict[str, Any], core: Any) -> Step:
    if line["call"] not in _CALLS:
        raise LookupError(f"line {number}: {line['call']!r} is nothing that a core is told")
    args = tuple(map(_lively, line["args"]))
    effects = getattr(core, line["call"])(*args, line["at"], **line["named"])
    return Step(
        number,
        line["end"],
        line["core"],
        line["at"],
        line["call"],
        args,
        line["named"],
        tuple(effects),
        _digest(effects) == line["answer"],
    )


def _digest(effects: list[Effect]) -> str:
    return hashlib.blake2b(repr(effects).encode(), digest_size=8).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return {"bytes": base64.b64encode(value).decode()}
    if isinstance(value, SeenTopic):
        return {"seen": _converter.unstructure(value)}
    return value


def _lively(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    if "bytes" in value:
        return base64.b64decode(value["bytes"])
    return _converter.structure(value["seen"], SeenTopic)


def _new_converter() -> cattrs.Converter:
    converter = cattrs.Converter()
    converter.register_unstructure_hook(bytes, lambda value: base64.b64encode(value).decode())
    converter.register_structure_hook(bytes, lambda value, _: base64.b64decode(value))
    return converter


_converter = _new_converter()
