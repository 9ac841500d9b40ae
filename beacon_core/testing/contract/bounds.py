"""Every limit, at it and one over it; and stamps, which have no limits."""

from __future__ import annotations

from typing import Any

import attrs
import pytest

from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.lifecycle import Cause, Status
from beacon_core.limits import DEFAULT_LIMITS, MAX_PAYLOAD_BYTES
from beacon_core.outcome import Verdict
from beacon_core.testing.contract.base import ContractBase, hint, known
from beacon_core.testing.examples import BENCH_HINT
from beacon_core.testing.harness import Harness, Listener
from beacon_core.testing.hostile import OVERSIZE_PAYLOAD

__all__ = ["BoundsChecks"]

_L = DEFAULT_LIMITS
_E = BeaconHint("engine")
_SECOND_NS = 1_000_000_000
_YEAR_NS = 365 * 86_400 * _SECOND_NS


def _ids(count: int) -> tuple[str, ...]:
    return tuple(f"id-{number}" for number in range(count))


def _entries(count: int) -> dict[str, str]:
    return {f"key-{number:02d}": "value" for number in range(count)}


def _string(length: int, field: str) -> BeaconHint:
    given: dict[str, Any] = {field: "x" * length}
    return attrs.evolve(_E, **given)


_STRINGS = ("display_name", "transport_type", "negotiated_format", "process_name", "hostname")

_AT_THE_LIMIT = {
    "entity_id": BeaconHint("e" * _L.max_id_length),
    "stable_id": _string(_L.max_id_length, "stable_id"),
    "component_id": _string(_L.max_id_length, "component_id"),
    **{field: _string(_L.max_string_length, field) for field in _STRINGS},
    "display_name-multibyte": attrs.evolve(_E, display_name="é" * (_L.max_string_length // 2)),
    "function_ids": attrs.evolve(_E, function_ids=_ids(_L.max_function_ids)),
    "function_ids-length": attrs.evolve(_E, function_ids=("f" * _L.max_id_length,)),
    "depends_on": attrs.evolve(_E, depends_on=_ids(_L.max_depends_on)),
    "metadata": attrs.evolve(_E, metadata=_entries(_L.max_metadata_entries)),
    "metadata-key": attrs.evolve(_E, metadata={"k" * _L.max_metadata_key_length: "v"}),
    "metadata-value": attrs.evolve(_E, metadata={"k": "v" * _L.max_metadata_value_length}),
    "process_id": attrs.evolve(_E, process_id=2**32 - 1),
}

_OVER_THE_LIMIT = {
    "stable_id": (_string(_L.max_id_length + 1, "stable_id"), _E),
    "component_id": (_string(_L.max_id_length + 1, "component_id"), _E),
    **{
        field: (_string(_L.max_string_length + 1, field), _string(_L.max_string_length, field))
        for field in _STRINGS
    },
    "display_name-multibyte": (
        attrs.evolve(_E, display_name="x" + "é" * (_L.max_string_length // 2)),
        attrs.evolve(_E, display_name="x" + "é" * (_L.max_string_length // 2 - 1)),
    ),
    "function_ids": (
        attrs.evolve(_E, function_ids=_ids(_L.max_function_ids + 1)),
        attrs.evolve(_E, function_ids=_ids(_L.max_function_ids)),
    ),
    "function_ids-length": (
        attrs.evolve(_E, function_ids=("f" * (_L.max_id_length + 1), "g")),
        attrs.evolve(_E, function_ids=("g",)),
    ),
    "depends_on": (
        attrs.evolve(_E, depends_on=_ids(_L.max_depends_on + 1)),
        attrs.evolve(_E, depends_on=_ids(_L.max_depends_on)),
    ),
    "metadata": (
        attrs.evolve(_E, metadata=_entries(_L.max_metadata_entries + 1)),
        attrs.evolve(_E, metadata=_entries(_L.max_metadata_entries)),
    ),
    "metadata-key": (
        attrs.evolve(_E, metadata={"k" * (_L.max_metadata_key_length + 1): "v", "fine": "v"}),
        attrs.evolve(_E, metadata={"fine": "v"}),
    ),
    "metadata-value": (
        attrs.evolve(_E, metadata={"k": "v" * (_L.max_metadata_value_length + 1)}),
        attrs.evolve(_E, metadata={"k": "v" * _L.max_metadata_value_length}),
    ),
}


def _largest() -> BeaconHint:
    """Every limit reached at once."""
    ids = tuple(f"{number:03d}" + "i" * (_L.max_id_length - 3) for number in range(100))
    width = _L.max_metadata_key_length - 2
    value = "v" * _L.max_metadata_value_length
    text = "t" * _L.max_string_length
    return BeaconHint(
        entity_id="e" * _L.max_id_length,
        stable_id="s" * _L.max_id_length,
        function_ids=ids[: _L.max_function_ids],
        depends_on=ids[: _L.max_depends_on],
        component_id="c" * _L.max_id_length,
        process_id=2**32 - 1,
        metadata={f"{n:02d}" + "k" * width: value for n in range(_L.max_metadata_entries)},
        **dict.fromkeys(_STRINGS, text),
    )


class BoundsChecks(ContractBase):
    """What is allowed passes untouched, what is not is repaired and reported."""

    @pytest.mark.parametrize("limit", _AT_THE_LIMIT)
    def test_at_a_limit_nothing_is_touched(self, harness: Harness, limit: str) -> None:
        said = _AT_THE_LIMIT[limit]
        listener = Listener(harness).start()
        harness.announcer().announce(said)
        self.active(harness, listener, said.entity_id)
        assert known(listener, said.entity_id).hint == said
        assert not any(call.outcome.repairs for call in listener.tap.calls)
        self.conclude(harness, listener)

    @pytest.mark.parametrize("limit", _OVER_THE_LIMIT)
    def test_over_a_limit_a_hint_is_repaired_and_the_repair_reported(
        self, harness: Harness, limit: str
    ) -> None:
        said, kept = _OVER_THE_LIMIT[limit]
        listener = Listener(harness).start()
        harness.announcer().announce(said)
        self.active(harness, listener, "engine")
        assert known(listener, "engine").hint == kept
        # The store has it a moment before the call is over.
        self.eventually(harness, lambda: bool(listener.tap.calls), "what was heard is noted")
        field = limit.partition("-")[0]
        repairs = [repair for call in listener.tap.calls for repair in call.outcome.repairs]
        assert repairs
        assert all(repair.startswith(f"$.{field}") for repair in repairs)
        self.conclude(harness, listener)

    def test_the_largest_hint_there_may_be_arrives_intact(self, harness: Harness) -> None:
        said = _largest()
        listener = Listener(harness).start()
        harness.announcer().announce(said)
        self.active(harness, listener, said.entity_id)
        assert known(listener, said.entity_id).hint == said
        self.conclude(harness, listener)

    def test_the_largest_payload_there_may_be_is_read(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        payload = harness.encode(hint("engine"))
        harness.send_raw("engine", payload + b" " * (MAX_PAYLOAD_BYTES - len(payload)))
        self.active(harness, listener, "engine")
        self.conclude(harness, listener)

    def test_a_larger_payload_is_refused_and_harms_nobody(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        payload = harness.encode(hint("engine"))
        harness.send_raw("engine", payload + b" " * (MAX_PAYLOAD_BYTES + 1 - len(payload)))
        harness.send_raw("another", OVERSIZE_PAYLOAD)
        self.eventually(
            harness, lambda: listener.count(Verdict.TOO_LARGE) == 2, "both payloads are refused"
        )
        harness.announcer().announce(hint("neighbour"))
        self.active(harness, listener, "neighbour")
        self.conclude(harness, listener)

    def test_a_stamp_in_the_past_gives_the_age(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        self._send_stamped(harness, harness.clock.wall_ns() - 60 * _SECOND_NS)
        self.active(harness, listener, "engine")
        age_ns = self._age_ns(harness, listener)
        assert 60 * _SECOND_NS <= age_ns <= (60 + harness.patience_s) * _SECOND_NS
        self.conclude(harness, listener)

    def test_a_stamp_older_than_the_time_to_live_makes_a_stale_hint(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness, ttl_s=60.0).start()
        self._send_stamped(harness, harness.clock.wall_ns() - 120 * _SECOND_NS)
        self.reaches(harness, listener, "engine", Status.STALE)
        assert known(listener, "engine").cause is Cause.HEARD_LATE
        self.conclude(harness, listener)

    @pytest.mark.parametrize("ahead_ns", [1, _SECOND_NS, _YEAR_NS, 200 * _YEAR_NS])
    def test_a_stamp_in_the_future_counts_as_just_now(
        self, harness: Harness, ahead_ns: int
    ) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        self._send_stamped(harness, harness.clock.wall_ns() + ahead_ns)
        self.active(harness, listener, "engine")
        assert self._age_ns(harness, listener) <= harness.patience_s * _SECOND_NS
        self.conclude(harness, listener)

    def test_no_stamp_counts_as_just_now(self, harness: Harness) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        self._send_stamped(harness, 0)
        self.active(harness, listener, "engine")
        assert self._age_ns(harness, listener) <= harness.patience_s * _SECOND_NS
        self.conclude(harness, listener)

    @pytest.mark.parametrize("stamp_ns", [1, _SECOND_NS, 10 * _YEAR_NS])
    def test_a_sender_whose_clock_is_wrong_is_seen_all_the_same_and_reported(
        self, harness: Harness, stamp_ns: int
    ) -> None:
        self.needs(harness, "raw_payloads")
        listener = Listener(harness).start()
        behind_ns = harness.clock.wall_ns() - stamp_ns
        self._send_stamped(harness, stamp_ns)
        self.active(harness, listener, "engine")
        source = known(listener, "engine").source
        offset_ns = next(
            report.clock_offset_ns for report in listener.intake.sources() if report.name == source
        )
        assert offset_ns is not None
        assert behind_ns <= offset_ns <= behind_ns + harness.patience_s * _SECOND_NS
        self.conclude(harness, listener)

    def test_a_stamp_survives_the_wire(self, harness: Harness) -> None:
        stamp_ns = harness.clock.wall_ns()
        decoded = harness.adapter.decode(harness.encode(BENCH_HINT, stamp_ns))
        assert getattr(decoded, "stamp_ns", None) == stamp_ns
        assert getattr(decoded, "hint", None) == BENCH_HINT

    @staticmethod
    def _send_stamped(harness: Harness, stamp_ns: int) -> None:
        try:
            payload = harness.encode(hint("engine"), stamp_ns)
        except UsageError as refusal:
            pytest.skip(f"{harness.adapter.name}: its wire format has no such stamp: {refusal}")
        harness.send_raw("engine", payload)

    @staticmethod
    def _age_ns(harness: Harness, listener: Listener) -> int:
        return known(listener, "engine").age_ns(harness.clock.monotonic_ns())
