"""The adapter of docs/write-your-own-adapter.md keeps the contract, as it stands there."""

from __future__ import annotations

import re
import sys
import tomllib
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import yaml

from beacon_core.ports.adapter import ENTRY_POINT_GROUP, Adapter
from beacon_gateway.config import parse_config

PAGE = Path(__file__).parents[2] / "docs" / "write-your-own-adapter.md"


def blocks(language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )


def modules() -> dict[str, ModuleType]:
    """Every Python block as the module that its first line names."""
    made = {}
    for source in blocks("python"):
        name = source.partition(".py")[0].removeprefix("# ")
        made[name] = sys.modules[name] = ModuleType(name)
        exec(compile(source, f"{PAGE.name}:{name}.py", "exec"), vars(made[name]))  # noqa: S102
    return made


MODULES = modules()
TestSpool = MODULES["test_spool"].TestSpool


def test_the_documented_entry_point_leads_to_the_adapter() -> None:
    (toml,) = blocks("toml")
    points = tomllib.loads(toml)["project"]["entry-points"][ENTRY_POINT_GROUP]
    for name, value in points.items():
        adapter = EntryPoint(name, value, ENTRY_POINT_GROUP).load()
        assert isinstance(adapter, Adapter)
        assert adapter.name == name


def test_the_documented_configuration_is_one() -> None:
    (text,) = blocks("yaml")
    adapter: Adapter = MODULES["beacon_spool"].ADAPTER
    loaded = parse_config(yaml.safe_load(text), {adapter.name: adapter}.__getitem__)
    (source,) = loaded.config.sources.values()
    assert source.options.directory == "/mnt/fleet/beacon"
    assert not loaded.corrections
