"""What may be configured of a ROS network and of a conduit over topics."""

from __future__ import annotations

from typing import Any

import cattrs
import pytest

from beacon_core.errors import ConfigError
from beacon_ros_topic.relay.options import RosConduitOptions, RosNetworkOptions

CONVERTER = cattrs.Converter(forbid_extra_keys=True)


@pytest.mark.parametrize(
    "wrong",
    [
        {"domain_id": -1},
        {"domain_id": 233},
        {"domain_id": "7"},
        {"domain_id": True},
        {"depth": 0},
        {"depth": 1.5},
        {"queue": 0},
        {"queue": 10_001},
    ],
)
def test_a_network_refuses_what_cannot_be_by_name(wrong: dict[str, Any]) -> None:
    (name,) = wrong
    with pytest.raises(ConfigError, match=rf"^{name}: .* cannot be used; write a whole number"):
        RosNetworkOptions(**wrong)


@pytest.mark.parametrize("prefix", ["", "relay", "/relay/", "/2", "/a b", 7, "/" + "x" * 200])
def test_a_conduit_refuses_a_prefix_that_is_no_name(prefix: Any) -> None:
    with pytest.raises(ConfigError, match=r"^prefix: .* such as /beacon_relay"):
        RosConduitOptions(prefix=prefix)


@pytest.mark.parametrize("wrong", [{"domain_id": 233}, {"depth": 0}, {"depth": "many"}])
def test_a_conduit_refuses_numbers_that_cannot_be(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=rf"^{next(iter(wrong))}: "):
        RosConduitOptions(**wrong)


@pytest.mark.parametrize(
    "options",
    [
        RosNetworkOptions(),
        RosNetworkOptions(domain_id=232, depth=1, queue=10_000),
        RosConduitOptions(),
        RosConduitOptions(prefix="/fleet/relay_7", domain_id=0, depth=1),
    ],
)
def test_options_are_plain_data(options: Any) -> None:
    assert CONVERTER.structure(CONVERTER.unstructure(options), type(options)) == options
