"""The store beside the C++ system's results: where we agree, and each difference by its name.

The C++ store is written down once more below, as naively as it goes, with a switch for each thing
that this store does otherwise on purpose. With all switches off the model must give what the C++
gave, so it is the C++'s rules that we differ from; with all of them on it must give what our store
gives. So every result that is not the C++'s is explained, in these cases and in any others.
"""

from __future__ import annotations

import enum
import json
import random
from pathlib import Path
from typing import Any

import attrs
import pytest

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_core.outcome import Verdict
from beacon_core.response import build_response
from beacon_core.store import HintStore
from beacon_core.stored import StoredHint

VECTORS = Path(__file__).parents[2] / "data" / "vectors" / "store.jsonl"
CASES = [json.loads(line) for line in VECTORS.read_text(encoding="utf-8").splitlines()]
NOW_NS = 10**9
"""Younger than the oldest hints are old: times before the start of the clock are times too."""


class Difference(enum.StrEnum):
    """What this store does otherwise."""

    EXPIRED = "expired"
    """The expired hold nothing: no room, no size, and no field of their id's next life."""
    FUTURE = "future"
    """A message from the future counts as sent just now."""
    OLDER = "older"
    """An older message changes nothing: no field, and not when the entity was last heard."""
    ROOM = "room"
    """In a full store whoever is stale gives way to a new id."""


EVERY = frozenset(Difference)


DIFFERENCES = {
    3: "expired",
    48: "expired",
    57: "expired future older",
    58: "expired future older room",
    59: "future older room",
    61: "expired room",
    65: "expired future older",
    66: "older",
    67: "expired future older",
    75: "future older",
    77: "older",
    79: "expired future older room",
    81: "future older room",
    85: "expired future",
    87: "expired older room",
    98: "expired future older",
    100: "expired future older",
    106: "future older room",
    107: "future older",
    110: "expired future",
    112: "expired older",
    114: "expired future older",
    119: "expired future",
}
"""Which differences can be seen in which case. The tests compute it; here it can be read."""


# -- the C++ store, and what is different --------------------------------------------------------


@attrs.define
class Entry:
    fields: dict[str, Any]
    last_seen_ns: int
    first_seen_ns: int


class Model:
    """The C++ store, but for the ``differences`` in force."""

    def __init__(self, config: dict[str, Any], differences: frozenset[Difference]) -> None:
        self.ttl_s, self.expiry_s = config["beacon_ttl_sec"], config["beacon_expiry_sec"]
        if self.expiry_s <= self.ttl_s:
            self.expiry_s = 10 * self.ttl_s
        self.max_hints = config["max_hints"]
        self.differences = differences
        self.entries: dict[str, Entry] = {}
        self.now_ns = NOW_NS

    def advance(self, op: dict[str, Any]) -> None:
        self.now_ns += op["ns"]
        if Difference.EXPIRED in self.differences:
            self.evict()

    def update(self, op: dict[str, Any]) -> bool:
        received_ns = self.now_ns - (op["age_ns"] or 0)
        if Difference.FUTURE in self.differences:
            received_ns = min(received_ns, self.now_ns)
        entry = self.entries.get(op["hint"]["entity_id"])
        if entry is not None:
            return self.refresh(entry, op["hint"], received_ns)
        age_s = (self.now_ns - received_ns) / 1e9
        if age_s >= self.expiry_s and Difference.EXPIRED in self.differences:
            return True
        if len(self.entries) >= self.max_hints and not self.gives_way():
            return False
        new = Entry(all_fields(op["hint"]), received_ns, received_ns)
        self.entries[op["hint"]["entity_id"]] = new
        return True

    def refresh(self, entry: Entry, hint: dict[str, Any], received_ns: int) -> bool:
        if received_ns < entry.last_seen_ns and Difference.OLDER in self.differences:
            return True
        entry.fields |= {name: value for name, value in hint.items() if value}
        entry.last_seen_ns = received_ns
        return True

    def gives_way(self) -> bool:
        stale = [one for one in self.entries if self.status(one) == "stale"]
        if not stale or Difference.ROOM not in self.differences:
            return False
        del self.entries[min(stale, key=self.worth)]
        return True

    def worth(self, entity_id: str) -> tuple[bool, int, str]:
        entry = self.entries[entity_id]
        return entry.last_seen_ns != entry.first_seen_ns, entry.last_seen_ns, entity_id

    def get(self, op: dict[str, Any]) -> dict[str, Any] | None:
        entry = self.entries.get(op["id"])
        if entry is None or self.status(op["id"]) == "expired":
            return None
        age_ns = self.now_ns - entry.last_seen_ns
        return {"status": self.status(op["id"]), "age_ns": age_ns, "hint": entry.fields.copy()}

    def response(self, op: dict[str, Any]) -> dict[str, Any] | None:
        found = self.get(op)
        if found is None:
            return None
        return {**found["hint"], "status": found["status"], "age_sec": found["age_ns"] / 1e9}

    def snapshot(self, op: dict[str, Any]) -> list[dict[str, Any]]:
        self.evict()
        return [self.get({"id": entity_id}) or {} for entity_id in sorted(self.entries)]

    def size(self, op: dict[str, Any]) -> int:
        return len(self.entries)

    def status(self, entity_id: str) -> str:
        age_s = (self.now_ns - self.entries[entity_id].last_seen_ns) / 1e9
        if age_s >= self.expiry_s:
            return "expired"
        return "stale" if age_s >= self.ttl_s else "active"

    def evict(self) -> None:
        for entity_id in [one for one in self.entries if self.status(one) == "expired"]:
            del self.entries[entity_id]


# -- our store, asked the same -------------------------------------------------------------------


class Store:
    def __init__(self, config: dict[str, Any]) -> None:
        self.clock = ManualClock(NOW_NS)
        self.store = HintStore(
            self.clock,
            ttl_s=config["beacon_ttl_sec"],
            expiry_s=config["beacon_expiry_sec"],
            max_hints=config["max_hints"],
        )

    def advance(self, op: dict[str, Any]) -> None:
        self.clock.advance(op["ns"])

    def update(self, op: dict[str, Any]) -> bool:
        fields: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value
            for name, value in op["hint"].items()
        }
        age_ns = op["age_ns"]
        received_ns = None if age_ns is None else self.clock.monotonic_ns() - age_ns
        verdict = self.store.update(BeaconHint(**fields), received_at_ns=received_ns)
        return verdict is not Verdict.STORE_FULL

    def get(self, op: dict[str, Any]) -> dict[str, Any] | None:
        stored = self.store.get(op["id"])
        return None if stored is None else self.described(stored)

    def response(self, op: dict[str, Any]) -> dict[str, Any] | None:
        stored = self.store.get(op["id"])
        return None if stored is None else build_response(stored, self.clock.monotonic_ns())

    def snapshot(self, op: dict[str, Any]) -> list[dict[str, Any]]:
        found = sorted(self.store.snapshot(), key=lambda stored: stored.entity_id)
        return [self.described(stored) for stored in found]

    def size(self, op: dict[str, Any]) -> int:
        return self.store.size()

    def described(self, stored: StoredHint) -> dict[str, Any]:
        body = build_response(stored, 0)
        del body["status"], body["age_sec"]
        age_ns = self.clock.monotonic_ns() - stored.last_seen_ns
        return {"status": stored.status.value, "age_ns": age_ns, "hint": body}


def all_fields(hint: dict[str, Any]) -> dict[str, Any]:
    body = build_response(given_out(BeaconHint(hint["entity_id"])), 0)
    del body["status"], body["age_sec"]
    return {**body, **hint}


def given_out(hint: BeaconHint) -> StoredHint:
    store = HintStore(ManualClock())
    store.update(hint)
    return store.snapshot()[0]


# -- the comparison ------------------------------------------------------------------------------


every_case = pytest.mark.parametrize(
    "case", [pytest.param(case, id=f"{case['n']} {case['name']}") for case in CASES]
)


@every_case
def test_the_model_without_differences_is_the_cpp_system(case: dict[str, Any]) -> None:
    assert modelled(case, frozenset()) == [op.get("expect") for op in case["ops"]]


@every_case
def test_the_store_gives_what_the_cpp_system_gives_but_for_the_differences(
    case: dict[str, Any],
) -> None:
    assert run(Store(case["config"]), case) == modelled(case, EVERY)


@every_case
def test_the_differences_of_a_case_are_those_named_above(case: dict[str, Any]) -> None:
    ours = modelled(case, EVERY)
    shown = [one for one in Difference if modelled(case, EVERY - {one}) != ours]
    assert " ".join(shown) == DIFFERENCES.get(case["n"], "")


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, id=f"{case['n']}") for case in CASES if case["n"] not in DIFFERENCES],
)
def test_a_case_without_a_named_difference_gives_the_very_results(case: dict[str, Any]) -> None:
    assert run(Store(case["config"]), case) == [op.get("expect") for op in case["ops"]]


@pytest.mark.parametrize("seed", range(100))
def test_other_cases_of_the_same_kind_give_what_the_rules_say(seed: int) -> None:
    case = drawn(random.Random(seed))  # noqa: S311 - the same in each run
    assert run(Store(case["config"]), case) == modelled(case, EVERY)


def drawn(draw: random.Random) -> dict[str, Any]:
    ttl_s = draw.choice([0.0, 0.1, 1.0, 10.0, 1 / 3])
    expiry_s = draw.choice([0.0, ttl_s, 3 * ttl_s, 2.0, 300.0])
    times_ns = [
        0,
        1,
        10**6,
        *(int(s * 1e9) for s in (ttl_s, expiry_s, ttl_s / 2, expiry_s - ttl_s)),
    ]
    ages_ns = [*times_ns, None, None, -(10**9), 6 * 10**11]
    ids, words = ["n0", "n1", "n2", "n3"], ["", "", "a", "b"]

    def op() -> dict[str, Any]:
        hint = {
            "entity_id": draw.choice(ids),
            "display_name": draw.choice(words),
            "function_ids": draw.choice([[], ["f"]]),
            "metadata": draw.choice([{}, {"a": "1"}]),
        }
        return draw.choice(
            [
                {"op": "update", "hint": hint, "age_ns": draw.choice(ages_ns)},
                {"op": "update", "hint": hint, "age_ns": draw.choice(ages_ns)},
                {"op": "advance", "ns": max(0, draw.choice(times_ns) + draw.choice([-1, 0, 0, 1]))},
                {"op": draw.choice(["get", "response"]), "id": draw.choice(ids)},
                {"op": draw.choice(["size", "snapshot"])},
            ]
        )

    config = {
        "beacon_ttl_sec": ttl_s,
        "beacon_expiry_sec": expiry_s,
        "max_hints": draw.choice([1, 2, 4, 100]),
    }
    return {"config": config, "ops": [op() for _ in range(60)]}


def modelled(case: dict[str, Any], differences: frozenset[Difference]) -> list[Any]:
    return run(Model(case["config"], differences), case)


def run(system: Model | Store, case: dict[str, Any]) -> list[Any]:
    return [getattr(system, op["op"])(op) for op in case["ops"]]
