from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.errors import ConfigError
from beacon_core.relay.names import Link, NameMap, Rule, find_loop
from beacon_core.relay.shaping import Shaping
from beacon_core.relay.values import Mode


def allow(pattern: str, to: str = "") -> Rule:
    return Rule(allow=True, pattern=pattern, to=to)


def deny(pattern: str) -> Rule:
    return Rule(allow=False, pattern=pattern)


def test_the_first_rule_that_fits_decides_and_says_so() -> None:
    names = NameMap((deny("/camera/raw"), allow("/camera/*"), allow("/odom", "/r1/odom")))
    raw, scaled, odom = map(names.rule_on, ("/camera/raw", "/camera/scaled", "/odom"))
    assert (raw.allowed, raw.rule, raw.reason) == (False, 0, "denied by rule 0: /camera/raw")
    assert (scaled.allowed, scaled.name, scaled.reason) == (
        True,
        "/camera/scaled",
        "allowed by rule 1: /camera/*",
    )
    assert (odom.name, odom.reason) == ("/r1/odom", "allowed by rule 2: /odom, renamed to /r1/odom")


def test_what_no_rule_fits_is_denied() -> None:
    ruling = NameMap((allow("/a/*"),)).rule_on("/a/b/c")
    assert (ruling.allowed, ruling.rule, ruling.reason) == (False, None, "denied: no rule fits")


@pytest.mark.parametrize(
    ("pattern", "to", "name", "out"),
    [
        ("/**", "/fleet/r1/**", "/a/b", "/fleet/r1/a/b"),
        ("/*/odom/**", "/odom/*/**", "/r1/odom/x/y", "/odom/r1/x/y"),
        ("/a/**", "", "/a", None),
        ("/a/*", "", "/a", None),
        ("/a", "", "/b", None),
        ("/a", "/b", "/a", "/b"),
    ],
)
def test_wildcards_carry_over_what_they_stand_for(
    pattern: str, to: str, name: str, out: str | None
) -> None:
    ruling = NameMap((allow(pattern, to),)).rule_on(name)
    assert (ruling.name or None) == out


def test_a_rule_may_say_what_is_promised() -> None:
    rule = Rule(allow=True, pattern="/a", mode=Mode.LATEST)
    assert NameMap((rule,)).rule_on("/a").mode is Mode.LATEST


@pytest.mark.parametrize("pattern", ["a", "/", "//a", "/a/", "/**/a", "/a*", "/***", ""])
def test_what_is_no_pattern_is_refused(pattern: str) -> None:
    with pytest.raises(ConfigError, match="is no pattern"):
        allow(pattern)


def test_a_new_name_must_have_the_wildcards_of_the_pattern() -> None:
    with pytest.raises(ConfigError, match="must have the wildcards"):
        allow("/*/a", "/a")
    with pytest.raises(ConfigError, match="no use in a rule that denies"):
        Rule(allow=False, pattern="/a", to="/b")


def both(there: NameMap, back: NameMap) -> list[Link]:
    return [Link("robot", "site", there), Link("site", "robot", back)]


def test_two_ways_with_the_same_names_are_a_loop_and_its_way_is_told() -> None:
    names = NameMap((allow("/**"),))
    assert find_loop(both(names, names)) == (
        "robot -> site: /**",
        "site -> robot: /**",
        "robot -> site: /**",
    )


def test_names_that_would_grow_for_ever_are_a_loop() -> None:
    found = find_loop(both(NameMap((allow("/**", "/a/**"),)), NameMap((allow("/**", "/b/**"),))))
    assert found is not None
    assert found[1] == "site -> robot: /** to /b/**"


@pytest.mark.parametrize(
    ("there", "back"),
    [
        ([allow("/r/**", "/from_r/**")], [allow("/s/**", "/from_s/**")]),
        ([allow("/a", "/b")], [allow("/a", "/b")]),
        ([deny("/x/**"), allow("/**", "/y/**")], [allow("/y/**", "/x/**")]),
        ([allow("/*/a")], [allow("/b/*/c"), deny("/**"), allow("/**")]),
        ([allow("/*", "/one/*")], [allow("/one/**", "/one/**"), deny("/**")]),
    ],
)
def test_ways_that_do_not_come_back_to_a_rule_are_none(there: list[Rule], back: list[Rule]) -> None:
    assert find_loop(both(NameMap(tuple(there)), NameMap(tuple(back)))) is None


def test_a_loop_over_three_networks_is_found() -> None:
    links = [
        Link("a", "b", NameMap((allow("/x", "/y"),))),
        Link("b", "c", NameMap((allow("/*", "/z/*"),))),
        Link("c", "a", NameMap((allow("/z/**", "/w/**"), allow("/*/y", "/*/q")))),
    ]
    assert find_loop(links) is None
    links[2] = Link("c", "a", NameMap((allow("/z/y", "/x"),)))
    assert find_loop(links) is not None


def test_a_way_into_a_loop_is_not_followed_for_ever() -> None:
    links = [
        Link("a", "b", NameMap((allow("/x"),))),
        Link("b", "c", NameMap((allow("/*"),))),
        Link("c", "b", NameMap((allow("/*"),))),
    ]
    assert find_loop(links) == ("b -> c: /*", "c -> b: /*", "b -> c: /*")


SEGMENTS = st.sampled_from(["a", "b", "*"])
PATTERNS = st.builds(
    lambda parts, rest: "/" + "/".join([*parts, *rest]),
    st.lists(SEGMENTS, min_size=1, max_size=2),
    st.sampled_from([[], ["**"]]),
)


@st.composite
def rules(draw: st.DrawFn) -> Rule:
    pattern = draw(PATTERNS)
    if draw(st.integers(0, 3)) == 0:
        return deny(pattern)
    wild = [one for one in pattern[1:].split("/") if one in {"*", "**"}]
    to = [draw(st.sampled_from(["a", "b"])), *wild] if draw(st.booleans()) else []
    return allow(pattern, "/" + "/".join(to) if to else "")


MAPS = st.lists(rules(), min_size=1, max_size=3).map(lambda some: NameMap(tuple(some)))


@settings(deadline=None)
@given(ab=MAPS, ba=MAPS, bc=MAPS, ca=MAPS)
def test_where_no_loop_is_found_no_name_passes_a_rule_twice(
    ab: NameMap, ba: NameMap, bc: NameMap, ca: NameMap
) -> None:
    links = [Link("a", "b", ab), Link("b", "a", ba), Link("b", "c", bc), Link("c", "a", ca)]
    if find_loop(links) is not None:
        return
    for name in ("/a", "/b", "/a/a", "/a/b", "/b/a", "/b/b", "/a/b/a", "/b/a/b/a"):
        ways = [("a", name, frozenset[tuple[int, int]]())]
        while ways:
            network, at, passed = ways.pop()
            for number, link in enumerate(links):
                ruling = link.names.rule_on(at)
                if link.source == network and ruling.allowed:
                    assert ruling.rule is not None
                    step = (number, ruling.rule)
                    assert step not in passed
                    ways.append((link.target, ruling.name, passed | {step}))


def test_a_rule_shapes_what_it_allows_and_nothing_that_it_denies() -> None:
    rule = Rule(allow=True, pattern="/a", shaping=Shaping(priority=3))
    assert NameMap((rule,)).rule_on("/a").shaping == Shaping(priority=3)
    with pytest.raises(ConfigError, match="'/a' is denied; leave out how it is to be sent"):
        Rule(allow=False, pattern="/a", shaping=Shaping(priority=3))
