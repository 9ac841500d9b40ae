"""What the package registers, and what it says when something is not installed."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import entry_points

import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.relaying import NETWORK_GROUP
from beacon_zenoh.rmw_relay import NETWORK, RmwNetworkOptions


def test_it_is_chosen_as_zenoh_rmw() -> None:
    (found,) = entry_points(group=NETWORK_GROUP, name="zenoh_rmw")
    assert found.load() is NETWORK
    assert (NETWORK.name, NETWORK.options) == ("zenoh_rmw", RmwNetworkOptions)


def test_a_network_is_a_domain_behind_a_router() -> None:
    here = NETWORK.identity(RmwNetworkOptions())
    assert here == "zenoh_rmw:0@tcp/127.0.0.1:7447"
    assert NETWORK.identity(RmwNetworkOptions(domain_id=7)) != here
    there = RmwNetworkOptions(connect=("tcp/10.0.0.1:7447", "tcp/10.0.0.2:7447"))
    assert NETWORK.identity(there) == "zenoh_rmw:0@tcp/10.0.0.1:7447,tcp/10.0.0.2:7447"
    router = RmwNetworkOptions(mode="router", listen=("tcp/0.0.0.0:7447",))
    assert NETWORK.identity(router) == "zenoh_rmw:0@tcp/0.0.0.0:7447"


@pytest.mark.parametrize("missing", ["zenoh", "xxhash"])
def test_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ConfigError, match="needs eclipse-zenoh and xxhash; run: pip install"):
        NETWORK.topic_side(RmwNetworkOptions())


def test_importing_it_imports_neither() -> None:
    script = (
        "import beacon_zenoh.rmw_relay, sys;"
        "sys.exit('zenoh' in sys.modules or 'xxhash' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("domain_id", -1),
        ("domain_id", 2**32),
        ("domain_id", True),
        ("domain_id", None),
        ("depth", 0),
        ("depth", 10_001),
        ("depth", "10"),
    ],
)
def test_an_option_that_cannot_be_is_refused_with_what_can(name: str, value: object) -> None:
    with pytest.raises(ConfigError, match=rf"{name}: .* write a whole number, \d+ to \d+"):
        RmwNetworkOptions(**{name: value})  # type: ignore[arg-type]
