"""Canonical results hold what is the same for every carrier, and nothing else."""

from __future__ import annotations

import json

import pytest

from beacon_core.hint import BeaconHint
from beacon_core.testing.contract.canonical import canonical, expected
from beacon_core.testing.harness import Listener
from beacon_fake.harness import FakeHarness


def heard(*hints: BeaconHint, payloads: tuple[bytes, ...] = (), seed: int = 0) -> object:
    """What a store ends with that heard these hints, each from an announcer of its own."""
    harness = FakeHarness(seed=seed)
    listener = Listener(harness).start()
    harness.wait_until(lambda: False, 1.0 + seed)
    for hint in hints:
        harness.announcer().announce(hint)
    for payload in payloads:
        harness.send_raw("", payload)
    harness.wait_until(lambda: False, 1.0)
    harness.close()
    return canonical(listener)


def test_times_senders_and_runs_make_no_difference() -> None:
    assert heard(BeaconHint("a"), seed=1) == heard(BeaconHint("a"), seed=2)


def test_it_is_plain_json() -> None:
    result = heard(BeaconHint("a", hostname="x"), BeaconHint("a", hostname="y"), payloads=(b"?",))
    assert json.loads(json.dumps(result)) == result


def test_repairs_and_refusals_are_told_once_each() -> None:
    long = BeaconHint("a", hostname="h" * 600)
    assert heard(long, long, payloads=(b"?", b"??", b'{"entity_id": ""}')) == {
        "entities": {
            "a": {
                "status": "active",
                "cause": "heard",
                "hostname": "hhhhhhhhhhhhhhhhhhhh... (512 bytes)",
                "restarts": 1,
            }
        },
        "repairs": ["$.hostname: truncated 600 -> 512 bytes"],
        "refused": ["invalid", "malformed"],
    }


def test_a_conflict_shows_both_claims() -> None:
    assert heard(BeaconHint("a", hostname="x"), BeaconHint("a", hostname="y")) == {
        "entities": {
            "a": {
                "status": "active",
                "cause": "heard",
                "hostname": "x",
                "claims": [{"hostname": "x"}, {"hostname": "y"}],
            }
        }
    }


def test_long_values_are_cut() -> None:
    ids = tuple(f"f{number}" for number in range(7))
    entries = {f"k{number}": "v" * number * 50 for number in range(7)}
    hint = BeaconHint("a", function_ids=ids, metadata=entries, depends_on=("b",))
    assert heard(hint, BeaconHint("b", metadata={"k": "v"}, process_id=7)) == {
        "entities": {
            "a": {
                "status": "active",
                "cause": "heard",
                "function_ids": ["f0", "f1", "f2", "f3", "f4", "(7 in all)"],
                "depends_on": ["b"],
                "metadata": {
                    "k0": "",
                    "k1": "v" * 50,
                    "k2": "v" * 20 + "... (100 bytes)",
                    "k3": "v" * 20 + "... (150 bytes)",
                    "k4": "v" * 20 + "... (200 bytes)",
                    "...": "(7 in all)",
                },
            },
            "b": {
                "status": "active",
                "cause": "heard",
                "process_id": 7,
                "metadata": {"k": "v"},
            },
        }
    }


def test_what_is_kept_is_found_by_the_name_of_the_check() -> None:
    assert expected("test_a_hint_arrives") == [
        {"entities": {"engine": {"status": "active", "cause": "heard"}}}
    ]
    assert expected("no such check") is None


@pytest.mark.parametrize("entity_id", ["left", "gone"])
def test_who_left_is_told_and_who_is_gone_is_not(entity_id: str) -> None:
    harness = FakeHarness()
    listener = Listener(harness).start()
    announcer = harness.announcer()
    announcer.announce(BeaconHint(entity_id))
    announcer.close()
    harness.wait_until(lambda: False, 1.0)
    if entity_id == "gone":
        listener.store.forget("gone")
    told = {} if entity_id == "gone" else {"left": {"status": "left", "cause": "goodbye"}}
    assert canonical(listener) == {"entities": told}
    harness.close()
