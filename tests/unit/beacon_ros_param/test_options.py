"""Options name the key and say what would be right; a configuration file is corrected."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.config import parse_config
from beacon_ros_param import ADAPTER, RosParamOptions


def test_the_defaults_are_those_of_ros2_medkit() -> None:
    options = RosParamOptions()
    assert (options.interval_s, options.budget_s, options.timeout_s) == (5.0, 10.0, 2.0)
    assert options.targets == ()
    assert options.domain_id is None


@pytest.mark.parametrize(
    ("key", "value", "right"),
    [
        ("domain_id", 233, "0 to 232"),
        ("domain_id", -1, "0 to 232"),
        ("domain_id", True, "0 to 232"),
        ("domain_id", "7", "0 to 232"),
        ("targets", "/driver", "a list of nodes' full names"),
        ("targets", ["driver"], "a list of nodes' full names"),
        ("targets", ["/arm/driver", "/arm/"], "a list of nodes' full names"),
        ("targets", [None], "a list of nodes' full names"),
        ("interval_s", 0.0999, "at least 0.1"),
        ("interval_s", float("nan"), "seconds"),
        ("budget_s", float("inf"), "seconds"),
        ("budget_s", True, "seconds"),
        ("timeout_s", "2", "seconds"),
        ("timeout_s", -1, "seconds"),
        ("max_in_flight", 0, "at least 1"),
        ("max_in_flight", 1.5, "at least 1"),
        ("forget_after_s", -0.1, "seconds"),
        ("forget_after_s", float("nan"), "seconds"),
        ("parameter_events", "yes", "true or false"),
        ("parameter_events", 1, "true or false"),
    ],
)
def test_what_cannot_be_is_refused_by_name(key: str, value: Any, right: str) -> None:
    with pytest.raises(ConfigError, match=rf"^{key}: .*{right}"):
        RosParamOptions(**{key: value})


def test_what_can_be_is_taken() -> None:
    targets: Any = ["/arm/driver", "/_hidden"]
    options = RosParamOptions(
        domain_id=232,
        targets=targets,
        interval_s=0.1,
        budget_s=0.1,
        timeout_s=0.1,
        max_in_flight=1,
        forget_after_s=0,
        parameter_events=False,
    )
    assert options.targets == ("/arm/driver", "/_hidden")


@pytest.mark.parametrize(
    ("key", "given", "used"),
    [
        ("interval_s", 0.0, 0.1),
        ("budget_s", -5, 0.1),
        ("timeout_s", 0.01, 0.1),
        ("max_in_flight", 0, 1),
    ],
)
def test_in_a_file_what_is_too_small_is_lifted_and_that_is_told(
    key: str, given: float, used: float
) -> None:
    document = {"sources": {"nodes": {"adapter": "ros_param", "options": {key: given}}}}
    loaded = parse_config(document, {"ros_param": ADAPTER}.__getitem__)
    assert getattr(loaded.config.sources["nodes"].options, key) == used
    (correction,) = loaded.corrections
    assert correction.path == f"$.sources.nodes.options.{key}"


@pytest.mark.parametrize(
    ("ttl_s", "interval_s", "used", "corrected"),
    [
        (15.0, 5.0, 15.0, False),
        (5.1, 5.0, 5.1, False),
        (5.0, 5.0, 15.0, True),
        (1, 400, 1200, True),
    ],
)
def test_in_a_file_a_time_to_live_outlives_the_interval(
    ttl_s: float, interval_s: float, used: float, *, corrected: bool
) -> None:
    nodes = {"adapter": "ros_param", "ttl_s": ttl_s, "options": {"interval_s": interval_s}}
    loaded = parse_config({"sources": {"nodes": nodes}}, {"ros_param": ADAPTER}.__getitem__)
    source = loaded.config.sources["nodes"]
    assert source.ttl_s == used
    assert source.expiry_s > source.ttl_s
    told = [one.message for one in loaded.corrections if one.path == "$.sources.nodes.ttl_s"]
    assert bool(told) == corrected
    if corrected:
        words = f"{float(ttl_s)} is not above interval_s ({float(interval_s)}); using {float(used)}"
        assert told == [words]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "fast"])
def test_in_a_file_what_is_no_number_is_refused(value: object) -> None:
    document = {"sources": {"nodes": {"adapter": "ros_param", "options": {"interval_s": value}}}}
    with pytest.raises(ConfigError, match="interval_s"):
        parse_config(document, {"ros_param": ADAPTER}.__getitem__)
