"""The keys of topics and services."""

from __future__ import annotations

import pytest

from beacon_zenoh.rmw import keys
from beacon_zenoh.rmw.keys import DataKey

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
TEXT = f"3/chatter/std_msgs::msg::dds_::String_/{STRING}"
KEY = DataKey(3, "/chatter", "std_msgs/msg/String", STRING)


def test_a_topic_is_written_and_read() -> None:
    assert keys.data_key(KEY) == TEXT
    assert keys.data_key_of(TEXT) == KEY


def test_a_service_is_written_like_a_topic() -> None:
    key = DataKey(0, "/arm/driver/list_parameters", "rcl_interfaces/srv/ListParameters", "h")
    text = "0/arm/driver/list_parameters/rcl_interfaces::srv::dds_::ListParameters_/h"
    assert keys.data_key(key) == text
    assert keys.data_key_of(text) == key


def test_a_wildcard_stands_for_every_definition() -> None:
    assert keys.every_hash(KEY.domain, KEY.name, KEY.type_name) == TEXT.replace(STRING, "*")


def test_what_is_kept_is_asked_of_one_session_or_of_all() -> None:
    assert keys.kept_key(TEXT, "ab", 2) == f"{TEXT}/@adv/pub/ab/2/_"
    assert keys.kept_by(TEXT) == f"{TEXT}/@adv/pub/**?_anyke"
    assert keys.kept_by(TEXT, "ab") == f"{TEXT}/@adv/pub/ab/**?_anyke"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "3",
        TEXT.replace("3/", "03/"),
        TEXT.replace("3/", "4294967296/"),
        TEXT.replace("chatter", "2"),
        TEXT.replace("chatter", "c" * 256),
        TEXT.replace("String_", "String"),
        TEXT + "/more",
        TEXT + "\n",
        TEXT.replace(STRING, "*"),
        TEXT * 20,
    ],
)
def test_what_is_no_key_of_data_gives_nothing(text: str) -> None:
    assert keys.data_key_of(text) is None


@pytest.mark.parametrize(
    ("wanted", "most"),
    [("3", 3), ("0", 0), ("", 0), (None, 0), ("-1", 0), ("x", 0), ("²", 0), ("9" * 10, 0)],
)
def test_how_many_kept_messages_are_wanted_is_read_or_all(wanted: str | None, most: int) -> None:
    assert keys.at_most(wanted) == most
