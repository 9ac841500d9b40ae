"""docs/adapters/zenoh_conduit.md says what there is, and its examples are ones."""

from __future__ import annotations

import re
from pathlib import Path

import attrs
import cattrs
import yaml

from beacon_zenoh.options import SessionOptions
from beacon_zenoh.relay import CONDUIT, RelayOptions
from beacon_zenoh.relay.conduit import DEFAULTS

PAGE = (Path(__file__).parents[4] / "docs" / "adapters" / "zenoh_conduit.md").read_text("utf-8")


def test_every_option_is_named_and_those_of_the_conduit_have_a_row() -> None:
    fields, shared = attrs.fields_dict(RelayOptions), attrs.fields_dict(SessionOptions)
    assert [name for name in fields if f"`{name}`" not in PAGE] == []
    assert [name for name in fields if name not in shared and f"\n| `{name}` |" not in PAGE] == []


def test_the_examples_are_options() -> None:
    examples = re.findall(r"^```yaml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    assert len(examples) == 2
    for example in (yaml.safe_load(text)["conduit"] for text in examples):
        assert example["adapter"] == CONDUIT.name
        options = cattrs.Converter(forbid_extra_keys=True).structure(
            example["options"], RelayOptions
        )
        assert CONDUIT.identity(options) == "zenoh:beacon/yard"


def test_the_times_are_those_of_the_session() -> None:
    tx = DEFAULTS["transport"]["link"]["tx"]
    assert f"{tx['lease']} ms" in PAGE
    drop = tx["queue"]["congestion_control"]["drop"]  # type: ignore[index]
    assert f"{drop['wait_before_drop'] // 1000} ms for each" in PAGE
