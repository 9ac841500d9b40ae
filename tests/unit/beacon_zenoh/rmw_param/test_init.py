"""The package: what it registers, and what it says when something is not installed."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_core.wire import json
from beacon_gateway.config import parse_config
from beacon_zenoh.rmw_param import ADAPTER, RmwParamOptions


def test_the_adapter_is_complete() -> None:
    assert ADAPTER.name == "zenoh_rmw_param"
    assert ADAPTER.options is RmwParamOptions
    assert ADAPTER.decode is json.decode
    assert ADAPTER.vendor_endpoint == "x-medkit-param-beacon"
    assert ADAPTER.default_ttl_s == 15.0


@pytest.mark.parametrize("missing", ["zenoh", "xxhash"])
@pytest.mark.parametrize(
    ("make", "arguments"), [("source", ()), ("announcer", (None,)), ("examine", (1.0,))]
)
def test_one_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, make: str, arguments: tuple[object, ...], missing: str
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ConfigError, match=r"'zenoh_rmw_param' needs eclipse-zenoh and xxhash"):
        getattr(ADAPTER, make)(RmwParamOptions(), *arguments)


def test_importing_it_imports_neither() -> None:
    script = (
        "import beacon_zenoh.rmw_param, sys;"
        "sys.exit('zenoh' in sys.modules or 'xxhash' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


@pytest.mark.parametrize(
    ("key", "value"),
    [("targets", ["driver"]), ("interval_s", "5"), ("ros_domain_ids", []), ("namespaces", "/a")],
)
def test_what_cannot_be_is_refused_by_name(key: str, value: Any) -> None:
    with pytest.raises(ConfigError, match=rf"^{key}: "):
        RmwParamOptions(**{key: value})


def test_in_a_file_what_is_too_small_is_lifted_and_a_time_to_live_outlives_the_interval() -> None:
    source = {
        "adapter": "zenoh_rmw_param",
        "ttl_s": 3,
        "options": {"interval_s": 5, "timeout_s": 0},
    }
    loaded = parse_config({"sources": {"nodes": source}}, {"zenoh_rmw_param": ADAPTER}.__getitem__)
    nodes = loaded.config.sources["nodes"]
    assert nodes.options.timeout_s == 0.1
    assert nodes.ttl_s == 15.0
    assert {one.path for one in loaded.corrections} == {
        "$.sources.nodes.options.timeout_s",
        "$.sources.nodes.ttl_s",
    }
