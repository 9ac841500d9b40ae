"""Options of asking are the same for every carrier, and complain by name."""

from __future__ import annotations

from typing import Any

import attrs
import pytest

from beacon_core.errors import ConfigError
from beacon_core.parameters import polling


@attrs.frozen
class Options:
    """As an adapter would have them."""

    targets: tuple[str, ...] = polling.targets()
    interval_s: float = polling.interval_s()
    budget_s: float = polling.budget_s()
    timeout_s: float = polling.timeout_s()
    max_in_flight: int = polling.max_in_flight()
    forget_after_s: float = 0.0
    parameter_events: bool = polling.parameter_events()


def test_the_defaults_are_those_of_ros2_medkit() -> None:
    options: polling.Polling = Options()
    assert (options.interval_s, options.budget_s, options.timeout_s) == (5.0, 10.0, 2.0)
    assert options.max_in_flight == 128
    assert Options().targets == ()
    assert Options().parameter_events is True


def test_what_can_be_is_taken() -> None:
    least = dict.fromkeys(("interval_s", "budget_s", "timeout_s"), 0.1)
    given: dict[str, Any] = {"targets": ["/arm/driver", "/_hidden"], "max_in_flight": 1, **least}
    options = Options(parameter_events=False, **given)
    assert options.targets == ("/arm/driver", "/_hidden")
    assert options.interval_s == 0.1


@pytest.mark.parametrize(
    ("key", "value", "right"),
    [
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
        ("parameter_events", "yes", "true or false"),
        ("parameter_events", 1, "true or false"),
    ],
)
def test_what_cannot_be_is_refused_by_name(key: str, value: Any, right: str) -> None:
    with pytest.raises(ConfigError, match=rf"^{key}: .*{right}"):
        Options(**{key: value})


def test_a_gateway_is_told_what_it_may_lift() -> None:
    fields = attrs.fields_dict(Options)
    assert {name for name, field in fields.items() if field.metadata.get("at_least")} == {
        "interval_s",
        "budget_s",
        "timeout_s",
        "max_in_flight",
    }
    assert [name for name, field in fields.items() if field.metadata.get("ttl_above")] == [
        "interval_s"
    ]
