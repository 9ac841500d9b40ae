"""The examples of docs/adapters/fake.md run as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from beacon_fake import ADAPTER, FakeOptions
from beacon_gateway.config import parse_config

PAGE = Path(__file__).parents[3] / "docs" / "adapters" / "fake.md"


def blocks(language: str) -> list[str]:
    return re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL
    )


def test_the_examples_run_one_after_the_other() -> None:
    names: dict[str, object] = {}
    for source in blocks("python"):
        exec(compile(source, PAGE.name, "exec"), names)  # noqa: S102


def test_the_configuration_is_one() -> None:
    (text,) = blocks("yaml")
    loaded = parse_config(yaml.safe_load(text), {"fake": ADAPTER}.__getitem__)
    (source,) = loaded.config.sources.values()
    assert source.options == FakeOptions(network="demo", name="second-gateway")
