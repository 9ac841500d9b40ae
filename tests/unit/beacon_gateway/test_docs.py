"""The documents for people say what the code does: every key, every option, every example."""

from __future__ import annotations

import argparse
import importlib
import inspect
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import pytest
import yaml

from beacon_core.errors import ConfigError
from beacon_fake import FakeOptions
from beacon_gateway import cli, config, vendor
from beacon_gateway.console.exits import EXIT_CODES
from beacon_gateway.tree import manifest, rules
from beacon_gateway.tree.entries import (
    AppEntry,
    AreaEntry,
    BindingEntry,
    ComponentEntry,
    FunctionEntry,
    PolicyEntry,
)
from beacon_ros_param import RosParamOptions
from beacon_ros_topic import RosTopicOptions
from beacon_zenoh import ZenohOptions
from beacon_zenoh.options import TlsOptions
from beacon_zenoh.rmw import RmwOptions

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant

DOCS = Path(__file__).parents[3] / "docs"
CONFIGURATION = (DOCS / "configuration.md").read_text()
ENTITY_TREE = (DOCS / "entity-tree.md").read_text()
HTTP_API = (DOCS / "http-api.md").read_text()
COMMAND_LINE = (DOCS / "command-line.md").read_text()


def blocks(document: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", document, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize(
    "cls",
    [
        config.Config,
        config.HttpConfig,
        config.SourceConfig,
        config.EntitiesConfig,
        config.AreaEntry,
        config.ComponentEntry,
        config.AppEntry,
        config.FunctionEntry,
        config.DefaultComponent,
        ZenohOptions,
        TlsOptions,
        FakeOptions,
        RmwOptions,
        RosTopicOptions,
        RosParamOptions,
    ],
)
def test_every_key_of_the_configuration_is_documented(cls: type[attrs.AttrsInstance]) -> None:
    missing = [field.name for field in attrs.fields(cls) if f"`{field.name}`" not in CONFIGURATION]
    assert missing == []


def test_the_example_with_all_keys_has_all_keys_and_says_the_defaults() -> None:
    example = blocks(CONFIGURATION, "yaml")[0]
    document = yaml.safe_load(example)
    loaded = config.parse_config(document)
    assert loaded.corrections == ()

    def keys(cls: Any, given: dict[str, Any]) -> None:
        assert set(given) == {field.name for field in attrs.fields(cls)}

    keys(config.Config, document)
    keys(config.HttpConfig, document["http"])
    keys(config.SourceConfig, document["sources"]["robots"])
    keys(config.EntitiesConfig, document["entities"])
    default = config.default_config().config
    assert loaded.config.http == default.http
    assert loaded.config.sources["robots"] == default.sources["zenoh"]
    assert (
        attrs.evolve(loaded.config, sources=default.sources, entities=default.entities) == default
    )


@pytest.mark.parametrize(
    "entry", [PolicyEntry, AreaEntry, ComponentEntry, AppEntry, BindingEntry, FunctionEntry]
)
def test_every_key_of_a_manifest_is_documented(entry: type[attrs.AttrsInstance]) -> None:
    missing = [field.name for field in attrs.fields(entry) if f"`{field.name}`" not in ENTITY_TREE]
    assert missing == []


def test_every_code_of_a_manifests_problems_is_documented() -> None:
    codes = set(re.findall(r"R0\d\d", inspect.getsource(rules) + inspect.getsource(manifest)))
    assert {code for code in codes if code not in ENTITY_TREE} == set()
    assert len(codes) == 12


@pytest.mark.parametrize("example", blocks(CONFIGURATION, "yaml")[1:])
def test_the_other_examples_are_configurations_too(example: str) -> None:
    assert config.parse_config(yaml.safe_load(example)).corrections == ()


def test_the_problems_shown_are_those_that_are_reported() -> None:
    document = {
        "htp": {},
        "sources": {
            "robots": {"adapter": "zenoh", "ttl_s": float("nan"), "options": {"mode": "ruter"}},
            "plant": {"adapter": "zeno"},
        },
        "log_level": False,
    }
    with pytest.raises(ConfigError) as caught:
        config.parse_config(document)
    shown = blocks(CONFIGURATION, "console")[0].splitlines()[2:]
    assert [line.strip() for line in shown] == str(caught.value).splitlines()


def test_the_python_example_runs() -> None:
    (example,) = blocks(CONFIGURATION, "python")
    exec(example, {})  # noqa: S102 - our own example


def test_every_option_of_every_command_is_documented() -> None:
    for command in cli.COMMANDS:
        assert f"## `beacon {command}" in COMMAND_LINE
        section = COMMAND_LINE.partition(f"## `beacon {command}")[2].partition("\n## ")[0]
        module = importlib.import_module(f"beacon_gateway.commands.{command.replace('-', '_')}")
        parser: argparse.ArgumentParser = module.parser()
        for action in parser._actions:
            for flag in action.option_strings:
                if flag not in ("-h", "--help"):
                    assert re.search(rf"{flag}\b", section), f"{command} {flag}"


def test_the_exit_codes_are_the_same_in_the_help_and_in_the_document() -> None:
    shown = re.findall(r"^\| (\d+) \| (.*?) \|$", COMMAND_LINE, re.MULTILINE)
    assert shown == re.findall(r"^  (\d+) +(.*)$", EXIT_CODES, re.MULTILINE)


def shape(value: Any) -> Any:
    """A document without its values."""
    if isinstance(value, dict):
        return {key: shape(inner) for key, inner in value.items()}
    return [shape(inner) for inner in value] if isinstance(value, list) else None


def test_the_answers_shown_have_the_shape_of_real_ones(plant: Plant) -> None:
    listing, left = map(json.loads, blocks(HTTP_API, "json"))
    announcer = plant.announce(
        "engine_temp",
        display_name="Engine temperature",
        component_id="ecu_front",
        hostname="robot-1",
        process_id=4242,
        process_name="engine_temp_node",
    )
    assert shape(plant.ok("/apps")) == shape(listing)
    announcer.close()
    plant.settle()
    assert shape(plant.refused("/apps/engine_temp/x-medkit-beacon")[1]) == shape(left)


def test_every_key_of_the_vendor_endpoint_and_of_health_is_documented(plant: Plant) -> None:
    plant.announce("a", hostname="one").close()
    plant.announce("a", hostname="one", process_id=1, process_name="p")
    plant.announce("a", hostname="two", process_id=2)
    body = plant.ok("/apps/a/x-medkit-beacon")
    source = plant.ok("/health")["x-medkit-beacon"]["sources"][0]
    keys = {
        *body,
        *body["claims"][0],
        *body["sources"][0],
        *(key for step in body["history"] for key in step),
        *plant.ok("/health"),
        *source,
        *source["hints"],
    }
    assert len(body["history"]) > 0
    assert [key for key in sorted(keys) if f"`{key}`" not in HTTP_API and key != "status"] == []
    assert vendor.BEACON in HTTP_API
