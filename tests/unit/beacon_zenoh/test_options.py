"""Options: each wrong value is refused by name, with what would be right."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.errors import ConfigError
from beacon_zenoh import TlsOptions, ZenohOptions


def test_the_defaults_listen_and_connect_nowhere_by_themselves() -> None:
    options = ZenohOptions()
    assert options.mode is None
    assert options.connect == options.listen == ()
    assert options.prefix == "beacon"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mode": "server"}, "mode: 'server' .* router, client, peer"),
        ({"connect": "tcp/a:1"}, r"connect: 'tcp/a:1' .* list such as \['tcp/127.0.0.1:7447'\]"),
        ({"connect": [7]}, "connect: 7 "),
        ({"listen": ["http/a:1"]}, "listen: 'http/a:1' .* tcp, udp, tls, quic, ws"),
        ({"listen": ["tcp/"]}, "listen: 'tcp/'"),
        ({"prefix": "a//b"}, "prefix: 'a//b' .* letters"),
        ({"prefix": "p" * 129}, "prefix: .* 128 bytes at most"),
        ({"prefix": 1}, "prefix: 1 "),
        ({"user": "robot"}, "password: give user and password both"),
        ({"password": "x"}, "password: give user and password both"),
        ({"user": "robot", "password": 1}, "password: it is not a text"),
        ({"users_file": 1}, "users_file: 1 .* a text"),
        ({"config_file": None}, "config_file: None .* a text"),
        ({"config": []}, r"config: \[\] .* keys of Zenoh's configuration"),
        ({"config": {1: 2}}, r"config: \{1: 2\}"),
        ({"tls": {"ca": "x"}}, "tls: .* ca, certificate and key"),
    ],
)
def test_a_wrong_value_is_refused(given: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        ZenohOptions(**given)


@pytest.mark.parametrize("given", [{"certificate": "a"}, {"key": "b"}, {"ca": 1}, {"key": 2}])
def test_half_of_a_pair_of_papers_is_refused(given: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"certificate and key both|a text"):
        TlsOptions(**given)


def test_secrets_are_not_shown() -> None:
    options = ZenohOptions(user="robot", password="hush", config={"id": "hush"})  # noqa: S106
    assert "hush" not in repr(options)


def test_lists_as_a_file_gives_them_are_taken() -> None:
    endpoints: Any = ["tcp/10.0.0.1:7447", "tls/gateway.local:7447", "unixsock-stream//run/z.sock"]
    assert ZenohOptions(connect=endpoints).connect == tuple(endpoints)
