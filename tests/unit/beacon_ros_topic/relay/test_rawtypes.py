"""A type's name and hash are enough; what cannot be is refused in a sentence."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no types of ROS's")

from std_msgs.msg import String

from beacon_core.errors import ConfigError
from beacon_core.relay.values import TopicType
from beacon_ros_topic.relay import rawtypes
from beacon_ros_topic.relay.rawtypes import type_for

HASH = f"RIHS01_{'a1' * 32}"


def test_a_type_that_is_not_installed_is_made() -> None:
    made = type_for(TopicType("nobody_msgs/msg/Nothing", HASH))
    assert (made.__module__, made.__name__) == ("nobody_msgs.msg", "Nothing")
    assert type_for(TopicType("nobody_msgs/msg/Nothing", HASH)) is made


def test_what_is_installed_under_the_name_is_not_taken_since_it_may_be_another_version() -> None:
    assert type_for(TopicType("std_msgs/msg/String", HASH)) is not String


def test_where_none_can_be_made_the_installed_one_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rawtypes, "why_no_raw_types", lambda: "another middleware")
    assert type_for(TopicType("std_msgs/msg/String", HASH)) is String


@pytest.mark.parametrize(
    "name",
    ["", "String", "std_msgs/String", "std_msgs/msg/2D", "Std/msg/X", "a/msg/B/c", "a b/c/d"],
)
def test_a_name_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="is no name of a ROS message type"):
        type_for(TopicType(name, HASH))


@pytest.mark.parametrize("digest", ["", "md5:abc", HASH[:-1], HASH.upper(), f"{HASH}0"])
def test_a_hash_that_is_none_is_refused(digest: str) -> None:
    with pytest.raises(ConfigError, match="is no hash of a ROS type"):
        type_for(TopicType("std_msgs/msg/String", digest))
