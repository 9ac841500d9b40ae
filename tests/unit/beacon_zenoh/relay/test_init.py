"""What the package registers, and what it says when Zenoh is not installed."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import entry_points

import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.relaying import CONDUIT_GROUP
from beacon_zenoh.relay import CONDUIT, RelayOptions


def test_it_is_chosen_as_zenoh() -> None:
    (found,) = entry_points(group=CONDUIT_GROUP, name="zenoh")
    assert found.load() is CONDUIT
    assert (CONDUIT.name, CONDUIT.options) == ("zenoh", RelayOptions)


def test_ends_that_hear_each_other_are_those_of_one_prefix_and_link() -> None:
    assert CONDUIT.identity(RelayOptions()) == "zenoh:beacon/default"
    assert CONDUIT.identity(RelayOptions(prefix="a/b", link="c")) == "zenoh:a/b/c"


def test_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zenoh", None)
    with pytest.raises(ConfigError) as refusal:
        CONDUIT.conduit(RelayOptions())
    assert str(refusal.value) == (
        "conduit: 'zenoh' needs eclipse-zenoh; run: pip install 'beacon-core[zenoh]'"
    )


def test_importing_it_does_not_import_zenoh() -> None:
    script = "import beacon_zenoh.relay, sys; sys.exit('zenoh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
