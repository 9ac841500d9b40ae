"""What the package registers, and how ends find each other."""

from __future__ import annotations

from importlib.metadata import entry_points

import pytest

from beacon_core.errors import ConfigError
from beacon_core.ports.relaying import CONDUIT_GROUP
from beacon_core.testing.relay.conduit_harness import End
from beacon_local import CONDUIT, LocalOptions


def test_it_is_chosen_as_local() -> None:
    (found,) = entry_points(group=CONDUIT_GROUP, name="local")
    assert found.load() is CONDUIT
    assert (CONDUIT.name, CONDUIT.options) == ("local", LocalOptions)


def test_ends_of_one_identity_hear_each_other_and_no_others() -> None:
    here, there = LocalOptions("here"), LocalOptions("there")
    assert CONDUIT.identity(here) == "local:here" != CONDUIT.identity(there)
    one, same, other = (End(CONDUIT.conduit(name)).start() for name in (here, here, there))
    assert one.conduit.send(b"header", b"payload")
    assert same.sink.frames == [(b"header", b"payload")]
    assert not other.sink.up
    for end in (one, same, other):
        end.conduit.close()


@pytest.mark.parametrize("name", ["", 7, None])
def test_a_name_that_is_none_is_refused(name: object) -> None:
    with pytest.raises(ConfigError, match="name:"):
        LocalOptions(name)  # type: ignore[arg-type]
