# ruff: noqa: S311 - chance in tests is no secret
"""A link says how long a message takes; all chance comes from the generator it is given."""

from __future__ import annotations

import random

import pytest

from beacon_core.errors import ConfigError
from beacon_fake import LAN, LOCAL, STORM, WAN, Link


def test_without_jitter_every_message_takes_the_same_time() -> None:
    link = Link(latency_s=0.25)
    assert {link.delay_ns(random.Random(seed)) for seed in range(20)} == {250_000_000}


def test_jitter_comes_on_top_and_has_the_mean_it_says() -> None:
    link, rng = Link(latency_s=0.1, jitter_s=0.02), random.Random(1)
    delays = [link.delay_ns(rng) for _ in range(20_000)]
    assert min(delays) >= 100_000_000
    assert sum(delays) / len(delays) == pytest.approx(120_000_000, rel=0.01)


def test_only_the_given_share_is_held_back_and_never_longer_than_said() -> None:
    link, rng = Link(reorder=0.25, reorder_by_s=0.5), random.Random(1)
    times = [link.held_back_ns(rng) for _ in range(20_000)]
    held = [time for time in times if time]
    assert len(held) / len(times) == pytest.approx(0.25, abs=0.01)
    assert max(held) <= 500_000_001


@pytest.mark.parametrize("link", [LOCAL, LAN, WAN, STORM])
def test_presets_differ_only_in_numbers(link: Link) -> None:
    assert link.delay_ns(random.Random(1)) >= int(link.latency_s * 1e9)


@pytest.mark.parametrize("name", ["loss", "duplicate", "reorder"])
@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_a_share_outside_0_to_1_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"^{name}: "):
        Link(**{name: value})


@pytest.mark.parametrize("name", ["latency_s", "jitter_s", "reorder_by_s", "detect_s"])
@pytest.mark.parametrize("value", [-1.0, float("inf"), float("nan")])
def test_a_time_that_cannot_be_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"^{name}: "):
        Link(**{name: value})
