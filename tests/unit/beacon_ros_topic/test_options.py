"""Options: each wrong value is refused by name, with what would be right."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_ros_topic import RosTopicOptions


def test_the_defaults_hear_what_gateways_of_ros2_medkit_hear() -> None:
    options = RosTopicOptions()
    assert options.topic == "/ros2_medkit/discovery"
    assert options.domain_id is None
    assert (options.reliability, options.durability) == ("reliable", "volatile")
    assert options.depth == 10_000


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"topic": ""}, "topic: '' cannot be used; write a full topic name, such as /ros2_medkit"),
        ({"topic": "discovery"}, "topic: 'discovery'"),
        ({"topic": "/a/"}, "topic: '/a/'"),
        ({"topic": "/a//b"}, "topic: '/a//b'"),
        ({"topic": "/2a"}, "topic: '/2a'"),
        ({"topic": "/a\n"}, "topic: '/a"),
        ({"topic": "/ä"}, "topic: '/ä'"),
        ({"topic": "/" + "a" * 247}, "topic: '/aaa"),
        ({"topic": None}, "topic: None"),
        ({"domain_id": 233}, "domain_id: 233 cannot be used; write a whole number, 0 to 232"),
        ({"domain_id": -1}, "domain_id: -1"),
        ({"domain_id": 1.0}, "domain_id: 1.0"),
        ({"domain_id": True}, "domain_id: True"),
        ({"reliability": "sure"}, "reliability: 'sure' .* write one of reliable, best_effort"),
        ({"durability": "local"}, "durability: 'local' .* one of volatile, transient_local"),
        ({"depth": 0}, "depth: 0 .* write a whole number, 1 to 1000000"),
        ({"depth": 1_000_001}, "depth: 1000001"),
        ({"depth": "10"}, "depth: '10'"),
    ],
)
def test_a_wrong_value_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=f"^{said}"):
        RosTopicOptions(**given)


@pytest.mark.parametrize(
    "given",
    [
        {"topic": "/a"},
        {"topic": "/_a/b__c/D9"},
        {"topic": "/" + "a" * 246},
        {"domain_id": 0},
        {"domain_id": 232},
        {"reliability": "best_effort", "durability": "transient_local", "depth": 1},
    ],
)
def test_a_right_one_is_taken(given: dict[str, Any]) -> None:
    options = RosTopicOptions(**given)
    assert {name: getattr(options, name) for name in given} == given
