"""The caller's mistakes are one family."""

from __future__ import annotations

import pytest

from beacon_core.errors import BeaconError, ConfigError, UsageError


@pytest.mark.parametrize("kind", [ConfigError, UsageError])
def test_one_except_clause_catches_every_mistake_of_the_caller(kind: type[BeaconError]) -> None:
    with pytest.raises(BeaconError, match="ttl_s=-1"):
        raise kind("ttl_s=-1: expected more than 0")


def test_a_wrong_setting_is_not_a_wrong_call() -> None:
    assert not issubclass(ConfigError, UsageError)
    assert not issubclass(UsageError, ConfigError)


@pytest.mark.parametrize("kind", [ValueError, OSError, RuntimeError])
def test_they_are_not_mistaken_for_python_s_own(kind: type[Exception]) -> None:
    assert not issubclass(BeaconError, kind)
