"""Type hashes, held to what ROS itself computes: kept vectors, and all types that are installed."""

from __future__ import annotations

import json
import sysconfig
from pathlib import Path
from typing import Any

import pytest

from beacon_core.errors import UsageError
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_core.wire.rihs01 import type_hash

# Made by rosidl 4.6.6; odd_msgs has one of each thing that a definition may hold.
KEPT = Path(__file__).parents[3] / "data" / "rihs01.jsonl"
VECTORS: list[dict[str, Any]] = [json.loads(line) for line in KEPT.read_text("utf-8").splitlines()]

HINT = """
string entity_id
string stable_id
string display_name
string[] function_ids
string[] depends_on
string component_id
string transport_type
string negotiated_format
uint32 process_id
string process_name
string hostname
diagnostic_msgs/KeyValue[] metadata
builtin_interfaces/Time stamp
"""


@pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector["type"])
def test_it_is_what_ros_computes(vector: dict[str, Any]) -> None:
    assert type_hash(vector["type"], vector["definition"], vector["others"]) == vector["hash"]


def test_the_hash_of_the_hint_is_the_one_that_we_announce_with() -> None:
    others = {"diagnostic_msgs/msg/KeyValue": "string key\nstring value"}
    assert type_hash(TYPE_NAME, HINT, others) == TYPE_HASH


def test_all_types_that_are_installed_have_the_hash_that_ros_gave_them() -> None:
    share = Path(sysconfig.get_path("data")) / "share"
    messages = {name_of(path): path.read_text("utf-8") for path in share.glob("*/msg/*.msg")}
    services = {name_of(path): path.read_text("utf-8") for path in share.glob("*/srv/*.srv")}
    if not messages:
        pytest.skip(f"no ROS definitions are installed in {share}")
    computed = {
        name: type_hash(name, text, messages) for name, text in (messages | services).items()
    }
    assert computed == {name: given(share / f"{name}.json") for name in computed}


def name_of(path: Path) -> str:
    return f"{path.parts[-3]}/{path.parts[-2]}/{path.stem}"


def given(path: Path) -> str:
    found = json.loads(path.read_text("utf-8"))["type_hashes"][0]["hash_string"]
    return str(found)


@pytest.mark.parametrize(
    "text",
    ["int32 x", "int32 x # comment", "\n\n  int32\tx  \n", "int32 x 5", "int32 X=1\nint32 x"],
)
def test_what_does_not_travel_does_not_count(text: str) -> None:
    assert type_hash("a/msg/B", text) == type_hash("a/msg/B", "int32 x")


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("int32 x", "uint32 x"),
        ("int32 x", "int32 y"),
        ("int32 x\nint32 y", "int32 y\nint32 x"),
        ("int32[] x", "int32[3] x"),
        ("int32[3] x", "int32[<=3] x"),
        ("int32[3] x", "int32[4] x"),
        ("string x", "string<=3 x"),
        ("string<=3 x", "wstring<=3 x"),
    ],
)
def test_what_travels_counts(one: str, other: str) -> None:
    assert type_hash("a/msg/B", one) != type_hash("a/msg/B", other)


def test_a_type_is_looked_for_in_the_same_package_and_may_be_named_in_full() -> None:
    others = {"a/msg/C": "int32 x"}
    hashes = {type_hash("a/msg/B", f"{name} c", others) for name in ("C", "a/C", "a/msg/C")}
    assert len(hashes) == 1


@pytest.mark.parametrize(
    ("type_name", "text", "named"),
    [
        ("String", "", "'String' is no type"),
        ("std_msgs/String", "", "is no type"),
        ("a/msg/B", "int32 x\n---\nint32 y", "1 lines of '---'; 0 are right"),
        ("a/srv/B", "int32 x", "0 lines of '---'; 1 are right"),
        ("a/action/B", "---", "1 lines of '---'; 2 are right"),
        ("a/msg/B", "int32", "'int32' defines no field"),
        ("a/msg/B", "int32 2x", "'int32 2x' defines no field"),
        ("a/msg/B", "int7 x", "'int7 x' defines no field"),
        ("a/msg/B", "int32<=5 x", "'int32<=5 x' defines no field"),
        ("a/msg/B", "int32[0] x", "defines no field"),
        ("a/msg/B", "int32[" + "9" * 5000 + "] x", "defines no field"),
        ("a/msg/B", "C c", "a/msg/C: it is needed"),
        ("a/srv/B", "c/C c\n---", "c/msg/C: it is needed"),
    ],
)
def test_what_is_no_definition_is_refused_by_name(type_name: str, text: str, named: str) -> None:
    with pytest.raises(UsageError) as refusal:
        type_hash(type_name, text)
    assert named in str(refusal.value)
