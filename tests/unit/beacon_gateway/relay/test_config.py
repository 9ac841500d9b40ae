"""What can be written into a relay's configuration, and what people are told who err."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.relaying import CONDUIT_GROUP
from beacon_core.relay.names import Rule
from beacon_core.relay.settings import DEFAULT_FORWARDING, DEFAULT_REPUBLISHING
from beacon_core.relay.shaping import Shaping
from beacon_core.relay.values import Mode
from beacon_gateway.adapters import find_installed
from tests.unit.beacon_gateway.relay.plant import Plant, end

MS = 10**6


def problems(plant: Plant, ends: Any, **more: Any) -> list[str]:
    with pytest.raises(ConfigError) as found:
        plant.config(ends, **more)
    return str(found.value).splitlines()


def test_the_defaults_are_the_cores_own(plant: Plant) -> None:
    ends = plant.config({"a": end("n", "l", forward=[], republish=True)}).ends
    forward, republish = ends["a"].forward, ends["a"].republish
    assert forward is not None
    assert republish is not None
    assert forward.settings() == DEFAULT_FORWARDING
    assert republish.settings() == DEFAULT_REPUBLISHING


def test_rules_are_read_in_their_order(plant: Plant) -> None:
    rules = [
        {"deny": "/secret/**"},
        {"allow": "/camera/*", "to": "/front/*", "mode": "latest"},
        {"allow": "/**"},
    ]
    forward = plant.config({"a": end("n", "l", forward=rules)}).ends["a"].forward
    assert forward is not None
    assert forward.names().rules == (
        Rule(allow=False, pattern="/secret/**"),
        Rule(allow=True, pattern="/camera/*", to="/front/*", mode=Mode.LATEST),
        Rule(allow=True, pattern="/**"),
    )


def test_limits_are_given_beside_the_rules(plant: Plant) -> None:
    ends = plant.config(
        {
            "a": end(
                "n",
                "l",
                forward={"rules": [{"allow": "/**"}], "hold_bytes": 1000, "max_hops": 2},
                republish={"gap_s": 0.25, "advertise_delay_s": 3, "match_s": 0},
                origin=17,
            )
        }
    ).ends
    assert ends["a"].origin == 17
    assert ends["a"].forward is not None
    assert ends["a"].forward.settings().hold_bytes == 1000
    assert ends["a"].forward.settings().max_hops == 2
    assert ends["a"].republish is not None
    settings = ends["a"].republish.settings()
    assert (settings.gap_ns, settings.advertise_delay_ns, settings.match_ns) == (
        250 * MS,
        3000 * MS,
        0,
    )


@pytest.mark.parametrize(
    ("ends", "told"),
    [
        ({}, "$.ends: found no end; give at least one"),
        ({"a b": end("n", "l", republish=True)}, "$.ends: found an end named 'a b'"),
        ({"a": end("n", "l")}, "$.ends.a: this end does nothing; give forward with rules"),
        ({"a": end("n", "l", republish=False)}, "$.ends.a: this end does nothing"),
        ({"a": {"republish": True}}, "$.ends.a.network: missing; give a network"),
        (
            {"a": end("n", "l", forward=[{"allow": "/a", "deny": "/b"}])},
            "$.ends.a.forward.rules[0].deny: give one of allow and deny",
        ),
        (
            {"a": end("n", "l", forward=[{"allow": "camera"}])},
            "$.ends.a.forward.rules[0]: pattern: 'camera' is no pattern",
        ),
        (
            {"a": end("n", "l", forward=[{"allow": "/a", "mode": "newest"}])},
            "$.ends.a.forward.rules[0].mode: found the text 'newest'; give one of ordered, latest",
        ),
        (
            {"a": end("n", "l", forward=[{"alow": "/a"}])},
            "$.ends.a.forward.rules[0].alow: unknown key; did you mean 'allow'?",
        ),
        ({"a": end("n", "l", republish=True, origin=0)}, "$.ends.a.origin: give a whole number"),
        (
            {"a": {**end("n", "l", republish=True), "conduit": {"adapter": "pigeon"}}},
            f"$.ends.a.conduit.adapter: no {CONDUIT_GROUP} 'pigeon'",
        ),
        (
            {
                "a": {
                    **end("n", "l", republish=True),
                    "network": {"adapter": "memory", "options": {"nam": "x"}},
                }
            },
            "$.ends.a.network.options.nam: unknown key; did you mean 'name'?",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_place(plant: Plant, ends: Any, told: str) -> None:
    assert any(one.startswith(told) for one in problems(plant, ends)), problems(plant, ends)


def test_what_is_not_installed_is_told_with_what_there_is() -> None:
    with pytest.raises(ConfigError, match="no conduit 'locale' is installed; did you mean 'local'"):
        find_installed(CONDUIT_GROUP, "locale")


def test_an_installed_conduit_is_found_by_its_name() -> None:
    assert find_installed(CONDUIT_GROUP, "local").name == "local"


def test_a_rule_says_how_much_may_go_out_how_old_it_may_be_and_who_goes_first(
    plant: Plant,
) -> None:
    rules = [{"allow": "/a", "rate_hz": 5, "bytes_per_s": 1e6, "max_age_s": 0.5, "priority": 7}]
    ends = plant.config({"a": end("n", "l", forward={"rules": rules, "link_bytes_per_s": 1000})})
    forward = ends.ends["a"].forward
    assert forward is not None
    assert forward.names().rules[0].shaping == Shaping(5.0, 1e6, 500 * MS, 7)
    assert forward.settings().link_bytes_per_s == 1000.0


@pytest.mark.parametrize(
    ("rule", "complaint"),
    [
        ({"rate_hz": 0}, "rate_hz: 0.0 is no rate; give a number above 0"),
        ({"max_age_s": 0}, "max_age_ns: 0 is not possible"),
        ({"priority": 9}, "priority: 9 is not possible; give 0 to 7"),
    ],
)
def test_a_shape_that_cannot_be_meant_is_refused(
    plant: Plant, rule: dict[str, Any], complaint: str
) -> None:
    rules = [{"allow": "/a", **rule}]
    assert complaint in "\n".join(problems(plant, {"a": end("n", "l", forward=rules)}))


def test_a_link_that_may_carry_nothing_is_refused(plant: Plant) -> None:
    forward = {"rules": [{"allow": "/a"}], "link_bytes_per_s": -1}
    (problem,) = problems(plant, {"a": end("n", "l", forward=forward)})
    assert "link_bytes_per_s: found -1.0; give a number above 0" in problem
