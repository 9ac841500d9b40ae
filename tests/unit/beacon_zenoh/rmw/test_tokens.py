"""Tokens as they were captured, how rmw_zenoh numbers their owners, and what is no token."""

from __future__ import annotations

import pytest

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.rmw import qos
from beacon_zenoh.rmw.keys import DataKey
from beacon_zenoh.rmw.tokens import Kind, Member, every_token, gid_of, member_of, token_key

ZID = "65a7f98f16790eaa57496834c01292ba"
NODE = f"@ros2_lv/3/{ZID}/0/0/NN/%/%fleet%r1/sdk_talker"
PUBLISHER = (
    f"@ros2_lv/3/{ZID}/0/0/MP/%/%fleet%r1/sdk_talker/%ros2_medkit%discovery/"
    f"ros2_medkit_msgs::msg::dds_::MedkitDiscoveryHint_/{TYPE_HASH}/::,10:,:,:,,"
)


def test_a_captured_node_is_read_and_written() -> None:
    member = Member(Kind.NODE, 3, ZID, 0, 0, "sdk_talker", "/fleet/r1")
    assert member_of(NODE) == member
    assert token_key(member) == NODE
    assert member.node_name == "/fleet/r1/sdk_talker"
    assert member.node_key == (3, ZID, 0)


def test_a_captured_publisher_is_read_and_written() -> None:
    member = member_of(PUBLISHER)
    assert member is not None
    assert (member.kind, member.name) == (Kind.PUBLISHER, "/ros2_medkit/discovery")
    assert member.data_key == DataKey(3, "/ros2_medkit/discovery", TYPE_NAME, TYPE_HASH)
    assert member.qos == qos.Qos(depth=10)
    assert token_key(member) == PUBLISHER


def test_a_node_in_the_root_has_a_name_with_one_slash() -> None:
    member = Member(Kind.NODE, 0, "ab", 0, 0, "talker")
    assert token_key(member) == "@ros2_lv/0/ab/0/0/NN/%/%/talker"
    assert member.node_name == "/talker"


def test_a_gid_is_the_low_half_of_the_hash_and_then_the_high_one_each_little_endian() -> None:
    # XXH3-128 of nothing, as its authors publish it: high half, low half, big-endian.
    high, low = bytes.fromhex("99aa06d3014798d8"), bytes.fromhex("6001c324468d497f")
    assert gid_of("") == low[::-1] + high[::-1]


def test_a_gid_is_given_for_any_text() -> None:
    assert len(gid_of("\ud800")) == 16


def test_tokens_are_asked_for_by_domain_or_in_all() -> None:
    assert every_token(3) == "@ros2_lv/3/**"
    assert every_token() == "@ros2_lv/*/**"


@pytest.mark.parametrize(
    "key",
    [
        "",
        "@ros2_lv",
        NODE.replace("@ros2_lv", "@ros3_lv"),
        NODE.replace("/3/", "/03/"),
        NODE.replace("/3/", "/-3/"),
        NODE.replace("/3/", "/4294967296/"),
        NODE.replace(ZID, ZID + "0"),
        NODE.replace(ZID, "zid"),
        NODE.replace("NN", "XX"),
        NODE.replace("NN", "MP"),
        NODE + "/more",
        NODE.replace("sdk_talker", "sdk talker"),
        NODE.replace("sdk_talker", "%sdk_talker"),
        NODE.replace("%fleet", "fleet"),
        NODE.replace("%fleet", "%2fleet"),
        NODE.replace("/%/", "/enclave/"),
        NODE.replace("sdk_talker", "t" * 2048),
        PUBLISHER.replace("MP", "NN"),
        PUBLISHER.replace("MedkitDiscoveryHint_", "MedkitDiscoveryHint"),
        PUBLISHER.replace("%ros2_medkit", "ros2_medkit"),
        PUBLISHER.replace("RIHS01", "RIHS-01"),
        PUBLISHER.replace(",,", ","),
        PUBLISHER.replace("10", "ten"),
        PUBLISHER + "/more",
        PUBLISHER + "\n",
    ],
)
def test_what_is_no_token_gives_nothing(key: str) -> None:
    assert member_of(key) is None
