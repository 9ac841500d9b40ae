"""What the machine draws from: small worlds, few names, and hints that are likely to collide."""

from __future__ import annotations

from typing import Any

import attrs
from hypothesis import strategies as st

from beacon_core.hint import BeaconHint
from beacon_core.skew import SkewPolicy
from beacon_core.testing.hostile import HOSTILE_JSON, HOSTILE_PAYLOADS, OVERSIZE_PAYLOAD
from beacon_core.wire import json
from beacon_fake import LAN, STORM, Link

__all__ = [
    "BREAKS_THE_DECODER",
    "HINTS",
    "IDS",
    "PAYLOADS",
    "Age",
    "Setup",
    "ages",
    "hints",
    "ids",
    "links",
    "names",
    "payloads",
    "periods",
    "plain_words",
    "runs",
    "setups",
    "skews_s",
    "speakers",
    "stamps",
]


@attrs.frozen
class Setup:
    """Small enough that everything that can overflow does."""

    ttl_s: float
    expiry_factor: float
    max_hints: int
    max_bytes: int
    source_rate: float
    global_rate: float
    policy: SkewPolicy
    receivers: int
    max_removed: int
    max_remembered: int
    watched: bool
    seed: int


setups = st.builds(
    Setup,
    ttl_s=st.sampled_from([1.0, 10.0, 0.3]),
    expiry_factor=st.sampled_from([3.0, 1.5, 30.0, 1.0]),
    max_hints=st.sampled_from([100, 100, 4, 3, 1]),
    max_bytes=st.sampled_from([10**6, 10**6, 7_000, 4_000]),
    source_rate=st.sampled_from([1_000.0, 1_000.0, 20.0, 2.5]),
    global_rate=st.sampled_from([10_000.0, 10_000.0, 50.0, 4.0]),
    policy=st.sampled_from(SkewPolicy),
    receivers=st.integers(1, 2),
    max_removed=st.sampled_from([50, 4, 1]),
    max_remembered=st.sampled_from([10**6, 1_500]),
    watched=st.booleans(),
    seed=st.integers(0, 2**16),
)

BREAKS_THE_DECODER = b"broken decoder"
IDS = ["a", "b", "c", "d"]
WORDS: list[dict[str, Any]] = [
    {},
    {"hostname": "h1", "process_id": 1},
    {"hostname": "h1", "process_id": 2},
    {"hostname": "h2", "process_id": 1},
    {"hostname": "h3"},
    {"process_id": 3},
    {"display_name": "x", "depends_on": ("b", "c")},
    {"display_name": "y" * 500, "metadata": {"k": "é"}},
    {"display_name": "z", "hostname": "h1", "process_id": 1, "metadata": {"k": "v" * 900}},
    {"function_ids": ("f",), "transport_type": "tcp", "process_name": "p", "stable_id": "s"},
]
# By short names, so that a failing run can be read.
HINTS = {
    f"{entity_id}{number}": BeaconHint(entity_id, **words)
    for number, words in enumerate(WORDS)
    for entity_id in IDS
}
PAYLOADS = {
    **HOSTILE_PAYLOADS,
    **HOSTILE_JSON,
    "oversize": OVERSIZE_PAYLOAD,
    "broken-decoder": BREAKS_THE_DECODER,
    "bad-id": b'{"entity_id": "no id!"}',
    "stamped": b'{"entity_id": "a", "hostname": "h1", "stamp": {"sec": 1700000000}}',
    "repaired": b'{"entity_id": "b", "component_id": "no id!"}',
    **{name: json.encode(hint) for name, hint in HINTS.items()},
}

# Half of all talk is about one id, so that many claim it.
hints = st.sampled_from([*HINTS, *[name for name in HINTS if name.startswith("a")] * 2])
# Of a few who speak for several each, and do not say which process they are.
plain_words = st.lists(
    st.tuples(
        st.sampled_from([name for name in HINTS if name[1] in "06"]), st.sampled_from(["s1", "s2"])
    ),
    min_size=1,
    max_size=8,
)
special = st.sampled_from(["oversize", "broken-decoder", "bad-id", "stamped", "repaired"])
payloads = special | st.sampled_from(list(PAYLOADS))
ids = st.sampled_from(IDS)
names = st.sampled_from(["r1", "r2", "r3"])
speakers = st.sampled_from(["r1", "r2", "r3", "s1", "s2", ""])
# An incarnation and a sequence number.
runs = st.sampled_from(
    [("", 0), ("", 2), ("", 5), *((name, n) for name in ("i1", "i2") for n in range(6))]
)
links = st.sampled_from(
    [
        LAN,
        STORM,
        Link(loss=0.9),
        Link(duplicate=1.0, reorder=1.0, reorder_by_s=1.0),
        Link(latency_s=1.5, detect_s=0.0),
        Link(latency_s=0.0, duplicate=1.0),
    ]
)
periods = st.sampled_from([None, 0.3, 0.9, 1.5])
skews_s = st.sampled_from([0.0, 0.2, -0.5, -5.0, 60.0, -1e6])
Age = tuple[float, float, int]
# How long ago it was said: so many times the ttl, the expiry, and so many nanoseconds.
AGES = [
    *[(0, 0, 0), (0, 0, 1), (0, 0, -1), (0.1, 0, 0), (0.6, 0, 0), (-1, 0, 0)],
    *[(1, 0, -1), (1, 0, 0), (1.2, 0, 0), (2.5, 0, 0)],
    *[(0, 1, -1), (0, 1, 0), (0, 3, 0), (0, 1e6, 0)],
]
ages = st.sampled_from([None, *AGES])
stamps = st.sampled_from(
    [*[("no", AGES[0])] * 8, *(("beside", age) for age in AGES), *(("inside", age) for age in AGES)]
)
