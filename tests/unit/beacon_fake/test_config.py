"""Options are checked by name, and networks are found by name."""

from __future__ import annotations

import uuid
from collections.abc import Iterator

import attrs
import cattrs
import pytest

from beacon_core.errors import ConfigError, UsageError
from beacon_fake import (
    ADAPTER,
    FakeAnnouncer,
    FakeNetwork,
    FakeOptions,
    FakeSource,
    find_network,
    share_network,
    unshare_network,
)


@pytest.fixture
def name(network: FakeNetwork) -> Iterator[str]:
    name = uuid.uuid4().hex
    share_network(network, name)
    yield name
    unshare_network(name)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("network", ""),
        ("network", 7),
        ("name", None),
        ("clock_offset_s", float("nan")),
        ("clock_offset_s", "1"),
    ],
)
def test_a_wrong_option_is_refused_by_name(key: str, value: object) -> None:
    given: dict[str, object] = {key: value}
    with pytest.raises(ConfigError, match=f"^{key}: "):
        attrs.evolve(FakeOptions(), **given)  # type: ignore[arg-type]


def test_options_come_from_plain_data() -> None:
    plain = {"network": "demo", "name": "gateway", "clock_offset_s": -3}
    assert cattrs.structure(plain, FakeOptions) == FakeOptions("demo", "gateway", -3.0)


def test_a_shared_network_is_found_by_its_name(network: FakeNetwork, name: str) -> None:
    assert find_network(name) is network


def test_a_name_is_given_once(network: FakeNetwork, name: str) -> None:
    with pytest.raises(UsageError, match=name):
        share_network(network, name)


def test_an_unshared_network_is_not_found_any_more(network: FakeNetwork, name: str) -> None:
    unshare_network(name)
    unshare_network(name)
    with pytest.raises(ConfigError, match="share_network"):
        find_network(name)


def test_a_network_that_is_not_there_is_refused_with_those_that_are(name: str) -> None:
    with pytest.raises(ConfigError, match=name):
        find_network("nowhere")


def test_the_adapter_makes_both_ends_from_options(network: FakeNetwork, name: str) -> None:
    source = ADAPTER.source(FakeOptions(network=name, name="gateway"))
    announcer = ADAPTER.announcer(FakeOptions(network=name, name="robot", clock_offset_s=2.0), 1.0)
    assert isinstance(source, FakeSource)
    assert isinstance(announcer, FakeAnnouncer)
    assert (source.name, announcer.name) == ("gateway", "robot")
    assert network.names() == ["robot"]
