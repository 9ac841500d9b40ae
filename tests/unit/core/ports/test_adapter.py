"""What an adapter registers, and under which name."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.ports.adapter import ENTRY_POINT_GROUP, Adapter, Decoder, Malformed
from beacon_core.ports.examination import Finding, Level

PYPROJECT = Path(__file__).parents[4] / "pyproject.toml"


@attrs.frozen
class Options:
    """No options at all."""


def decode(payload: bytes) -> Announcement | Malformed:
    return Announcement(BeaconHint(payload.decode())) if payload else Malformed("$: empty")


def nothing(*_: Any) -> Any:
    return None


ADAPTER = Adapter("mine", Options, decode, source=nothing, announcer=nothing)


def test_our_own_adapters_are_registered_in_the_group_everyone_uses() -> None:
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    assert "fake" in project["entry-points"][ENTRY_POINT_GROUP]


def test_a_hint_lives_ten_seconds_unless_the_adapter_knows_better() -> None:
    assert ADAPTER.default_ttl_s == 10.0


def test_an_endpoint_of_its_own_and_an_examination_are_for_those_who_offer_them() -> None:
    assert ADAPTER.vendor_endpoint == ""
    assert ADAPTER.examine is None


def test_an_examination_tells_what_it_finds_with_these_options() -> None:
    def examine(options: Options, seconds: float) -> Iterator[Finding]:
        yield Finding(Level.OK, f"looked for {seconds} s with {options}")

    adapter = attrs.evolve(ADAPTER, examine=examine)
    assert adapter.examine is not None
    (finding,) = adapter.examine(Options(), 2.5)
    assert finding == Finding(Level.OK, "looked for 2.5 s with Options()")


def test_an_adapter_cannot_be_changed() -> None:
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        ADAPTER.name = "yours"  # type: ignore[misc]


def test_a_decoder_answers_by_value() -> None:
    decoder: Decoder = ADAPTER.decode
    assert decoder(b"a") == Announcement(BeaconHint("a"))
    assert decoder(b"") == Malformed("$: empty")
