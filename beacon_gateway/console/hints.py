"""Hints given by a person: from the command line or a YAML file, completed and checked."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs

from beacon_core.errors import ConfigError
from beacon_core.hint import BeaconHint
from beacon_core.validator import Rejected, validate
from beacon_gateway.documents import read_yaml
from beacon_gateway.problems import headed
from beacon_gateway.structuring import Structurer

__all__ = ["Checked", "checked_hint", "read_hints", "this_process"]


@attrs.frozen
class Checked:
    """A hint as it will be announced."""

    hint: BeaconHint
    repairs: tuple[str, ...]
    """What had to be mended in it."""


def read_hints(path: Path) -> list[BeaconHint]:
    """The hints of a file: one, or a list of them, in the fields of ``BeaconHint``.

    Raises ``ConfigError`` with every problem, each with its place.
    """
    document = read_yaml(path)
    try:
        if isinstance(document, list):
            return Structurer().structure(document, list[BeaconHint])
        return [Structurer().structure(document, BeaconHint)]
    except ConfigError as error:
        raise headed(str(path), error) from error


def this_process() -> Mapping[str, str | int]:
    """What this process knows of itself: the fields that say who speaks."""
    return {
        "process_id": os.getpid(),
        "process_name": "beacon",
        "hostname": socket.gethostname(),
    }


def checked_hint(hint: BeaconHint, defaults: Mapping[str, str | int]) -> Checked:
    """The hint with what it does not say filled in, and as a gateway will take it.

    Raises ``ConfigError`` for one that no gateway would take.
    """
    missing: dict[str, Any] = {
        name: value for name, value in defaults.items() if not getattr(hint, name)
    }
    result = validate(attrs.evolve(hint, **missing))
    if isinstance(result, Rejected):
        raise ConfigError(f"this hint would be refused: {result.reason}")
    return Checked(result.hint, result.repairs)
