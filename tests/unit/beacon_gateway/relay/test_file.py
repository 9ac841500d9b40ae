"""The file of a relay that runs by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.relay.file import load_relay_file
from tests.unit.beacon_gateway.relay.plant import Plant, end


def problems(plant: Plant, ends: Any, **more: Any) -> list[str]:
    with pytest.raises(ConfigError) as found:
        plant.config(ends, **more)
    return str(found.value).splitlines()


def test_only_this_machine_may_ask_a_relay_without_a_gateway(plant: Plant) -> None:
    ends = {"a": end("n", "l", republish=True)}
    (told,) = problems(plant, ends, http={"host": "0.0.0.0"})  # noqa: S104 - that is the point
    assert told.startswith("$.http.host: found '0.0.0.0'; this address is for this machine only")
    (told,) = problems(plant, ends, http={"port": 70_000})
    assert told.startswith("$.http.port: found the number 70000")


def test_a_file_is_read_and_an_empty_one_is_told_what_is_missing(
    plant: Plant, tmp_path: Path
) -> None:
    path = tmp_path / "relay.yaml"
    path.write_text(
        "ends:\n"
        "  robot:\n"
        "    network: {adapter: memory, options: {name: robot}}\n"
        "    conduit: {adapter: local}\n"
        "    forward:\n"
        "      - allow: /**\n"
    )
    read = load_relay_file(path, plant.find)
    assert (list(read.ends), read.identity) == (["robot"], str(path))
    path.write_text("")
    with pytest.raises(ConfigError, match=r"\$\.ends: missing; give ends by name"):
        load_relay_file(path, plant.find)
