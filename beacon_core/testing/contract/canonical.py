"""What a check ended with, in a form that is the same for every carrier.

Left out is what differs between carriers and runs: times, revisions, names of senders and their
incarnations, the carrier's words. What remains must be equal, and is compared with what is kept in
``canonical.json``, by the name of the check.
"""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

import attrs

from beacon_core.hint import BeaconHint
from beacon_core.outcome import Verdict
from beacon_core.stored import StoredHint
from beacon_core.testing.harness import Listener

__all__ = ["canonical", "expected"]

_REFUSALS = frozenset({Verdict.TOO_LARGE, Verdict.MALFORMED, Verdict.INVALID, Verdict.FAULT})


def canonical(listener: Listener) -> dict[str, Any]:
    """The entities by id, every repair that was reported, and every kind of refusal; plain JSON."""
    outcomes = [call.outcome for call in listener.tap.calls]
    result: dict[str, Any] = {
        "entities": {
            stored.entity_id: _entity(stored) for stored in listener.store.changes_since(0).hints
        }
    }
    if repairs := sorted({repair for outcome in outcomes for repair in outcome.repairs}):
        result["repairs"] = repairs
    if refused := sorted({outcome.verdict for outcome in outcomes} & _REFUSALS):
        result["refused"] = [str(verdict) for verdict in refused]
    return result


def expected(check: str) -> Any:
    """What is kept for this check; ``None`` if nothing is."""
    kept = resources.files(__package__).joinpath("canonical.json").read_text("utf-8")
    return json.loads(kept).get(check)


def _entity(stored: StoredHint) -> dict[str, Any]:
    entity: dict[str, Any] = {"status": str(stored.status), "cause": str(stored.cause)}
    entity.update(_given(stored.hint))
    if stored.restarts:
        entity["restarts"] = stored.restarts
    if stored.claims:
        entity["claims"] = [_given(claim.hint) for claim in stored.claims]
    return entity


def _given(hint: BeaconHint) -> dict[str, Any]:
    """The fields that are given, long ones cut: what they say in full a check compares itself."""
    fields = attrs.asdict(hint, recurse=False)
    del fields["entity_id"]
    fields["metadata"] = dict(hint.metadata)
    return {name: _short(value) for name, value in fields.items() if value}


def _short(value: Any) -> Any:
    if isinstance(value, str):
        return value if len(value) <= 80 else f"{value[:20]}... ({len(value.encode())} bytes)"
    if isinstance(value, tuple):
        return [_short(one) for one in value[:5]] + [f"({len(value)} in all)"] * (len(value) > 5)
    if isinstance(value, dict):
        few = {key: _short(one) for key, one in list(value.items())[:5]}
        return few | ({"...": f"({len(value)} in all)"} if len(value) > 5 else {})
    return value
