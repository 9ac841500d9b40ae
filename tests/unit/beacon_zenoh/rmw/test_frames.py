"""What an independent implementation put on the wire is read as what it meant."""

from __future__ import annotations

import json
from pathlib import Path

from beacon_core.hint import Announcement, BeaconHint
from beacon_core.wire import cdr
from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.rmw import attachment, keys, tokens
from beacon_zenoh.rmw.keys import DataKey
from beacon_zenoh.rmw.tokens import Kind

KEPT = Path(__file__).parents[3] / "data" / "rmw_zenoh" / "frames.jsonl"
FRAMES = [
    json.loads(line.replace("ZID", "adf050e00afc51570187996b685d9bb7"))
    for line in KEPT.read_text("utf-8").splitlines()
]
TOKENS = [one["key"] for one in FRAMES if one["key"].startswith("@")]
(MESSAGE,) = [one for one in FRAMES if one["payload"]]


def test_its_tokens_are_read_and_written_alike() -> None:
    members = [tokens.member_of(key) for key in TOKENS]
    assert [member and (member.kind, member.node_name) for member in members] == [
        (Kind.NODE, "/fleet/r1/talker"),
        (Kind.PUBLISHER, "/fleet/r1/talker"),
        (Kind.NODE, "/fleet/r1/ear"),
        (Kind.SUBSCRIBER, "/fleet/r1/ear"),
    ]
    assert [member and tokens.token_key(member) for member in members] == TOKENS
    assert [member is not None and member.qos.keeps for member in members] == [
        False,
        False,
        False,
        True,
    ]


def test_its_message_is_read() -> None:
    assert keys.data_key_of(MESSAGE["key"]) == DataKey(
        0, "/ros2_medkit/discovery", TYPE_NAME, TYPE_HASH
    )
    assert cdr.decode(bytes.fromhex(MESSAGE["payload"])) == Announcement(
        BeaconHint("engine", display_name="Engine", metadata={"mode": "idle"}), 0
    )


def test_its_attachment_is_read_and_written_alike() -> None:
    beside = bytes.fromhex(MESSAGE["attachment"])
    envelope = attachment.decode(beside)
    assert envelope is not None
    gid, sequence, stamp_ns = envelope
    assert sequence == 0
    assert stamp_ns > 1_700_000_000 * 10**9
    assert attachment.encode(gid, sequence, stamp_ns) == beside
