"""The package: what it registers, and what it says when something is not installed."""

from __future__ import annotations

import subprocess
import sys

import pytest

from beacon_core.errors import ConfigError
from beacon_core.wire import cdr
from beacon_zenoh.rmw import ADAPTER, RmwOptions


def test_the_adapter_is_complete() -> None:
    assert ADAPTER.name == "zenoh_rmw"
    assert ADAPTER.options is RmwOptions
    assert ADAPTER.decode is cdr.decode
    assert ADAPTER.vendor_endpoint == "x-medkit-topic-beacon"


@pytest.mark.parametrize("missing", ["zenoh", "xxhash"])
@pytest.mark.parametrize(
    ("make", "arguments"), [("source", ()), ("announcer", (None,)), ("examine", (1.0,))]
)
def test_one_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, make: str, arguments: tuple[object, ...], missing: str
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ConfigError) as refusal:
        getattr(ADAPTER, make)(RmwOptions(), *arguments)
    assert str(refusal.value) == (
        "adapter: 'zenoh_rmw' needs eclipse-zenoh and xxhash; run: pip install 'beacon-core[zenoh]'"
    )


def test_importing_it_imports_neither() -> None:
    script = (
        "import beacon_zenoh.rmw, sys; sys.exit('zenoh' in sys.modules or 'xxhash' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
