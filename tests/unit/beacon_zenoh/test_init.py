"""The package: what it registers, and what it says when Zenoh is not installed."""

from __future__ import annotations

import subprocess
import sys

import pytest

import beacon_zenoh
from beacon_core.errors import ConfigError
from beacon_core.wire import json
from beacon_zenoh import ADAPTER, ZenohOptions


def test_the_adapter_is_complete() -> None:
    assert ADAPTER.name == "zenoh"
    assert ADAPTER.options is ZenohOptions
    assert ADAPTER.decode is json.decode
    for name in beacon_zenoh.__all__:
        assert hasattr(beacon_zenoh, name)


@pytest.mark.parametrize(
    ("make", "arguments"), [("source", ()), ("announcer", (None,)), ("examine", (1.0,))]
)
def test_without_zenoh_one_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, make: str, arguments: tuple[object, ...]
) -> None:
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(ConfigError) as refusal:
        getattr(ADAPTER, make)(ZenohOptions(), *arguments)
    assert str(refusal.value) == (
        "adapter: 'zenoh' needs eclipse-zenoh; run: pip install 'beacon-core[zenoh]'"
    )


def test_importing_it_does_not_import_zenoh() -> None:
    script = "import beacon_zenoh, sys; sys.exit('zenoh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
