"""What a package registers for the relay."""

from __future__ import annotations

from typing import Any

import attrs
import pytest

from beacon_core.ports.relaying import (
    CONDUIT_GROUP,
    NETWORK_GROUP,
    ConduitAdapter,
    NetworkAdapter,
)


@attrs.frozen
class Options:
    """Where to."""

    domain: int = 0


def nothing(_: Options) -> Any:
    return None


def named(options: Options) -> str:
    return f"mine/{options.domain}"


CONDUIT = ConduitAdapter("mine", Options, nothing, named)
NETWORK = NetworkAdapter("mine", Options, nothing, named)


def test_conduits_and_networks_are_found_in_groups_of_their_own() -> None:
    assert CONDUIT_GROUP != NETWORK_GROUP


@pytest.mark.parametrize("adapter", [CONDUIT, NETWORK])
def test_its_identity_tells_one_from_another(adapter: ConduitAdapter | NetworkAdapter) -> None:
    assert adapter.identity(adapter.options(1)) != adapter.identity(adapter.options(2))


@pytest.mark.parametrize("adapter", [CONDUIT, NETWORK])
def test_it_cannot_be_changed(adapter: ConduitAdapter | NetworkAdapter) -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        adapter.name = "other"  # type: ignore[misc]
