"""Which names are legal, and how they are written in keys."""

from __future__ import annotations

import pytest

from beacon_zenoh.rmw import names


@pytest.mark.parametrize(
    ("name", "chunk"), [("/", "%"), ("", "%"), ("/arm/driver", "%arm%driver"), ("talker", "talker")]
)
def test_a_name_becomes_a_chunk(name: str, chunk: str) -> None:
    assert names.mangled(name) == chunk


@pytest.mark.parametrize("name", ["", "arm", "/arm/", "//arm", "/2", "/a b", "/a" * 128, "/é"])
def test_what_is_no_full_name(name: str) -> None:
    assert not names.is_name(name)


@pytest.mark.parametrize(
    "chunk", ["", "std_msgs/msg/String", "std_msgs::msg::dds_::String", "a::topic::dds_::B_", "::"]
)
def test_what_is_no_type_in_a_key(chunk: str) -> None:
    assert names.ros_type(chunk) is None


def test_types_are_told_from_other_text() -> None:
    assert names.is_type_name("std_msgs/msg/String")
    assert not names.is_type_name("std_msgs/String")


def test_only_the_root_is_a_namespace_without_a_name() -> None:
    assert names.is_namespace("/")
    assert not names.is_namespace("")


def test_a_name_may_be_as_long_as_ros_allows() -> None:
    assert names.is_name("/" + "a" * 254)
    assert not names.is_name("/" + "a" * 255)
    assert names.is_node_name("a" * 255)
    assert not names.is_node_name("a" * 256)
