"""From options to Zenoh's configuration: what overrides what, and what is refused when."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import zenoh

from beacon_core.errors import ConfigError
from beacon_zenoh import TlsOptions, ZenohOptions
from beacon_zenoh.config import reason, session_config
from beacon_zenoh.options import Mode


def setting(options: ZenohOptions, key: str, mode: Mode = "router") -> Any:
    """What Zenoh itself makes of it."""
    return json.loads(session_config(options, mode).make().get_json(key))


@pytest.mark.parametrize(
    ("mode", "connect", "listen"),
    [
        ("router", (), ("tcp/127.0.0.1:7447",)),
        ("client", ("tcp/127.0.0.1:7447",), ()),
        ("peer", (), ("tcp/127.0.0.1:0",)),
    ],
)
def test_without_endpoints_nothing_leaves_this_machine(
    mode: Mode, connect: tuple[str, ...], listen: tuple[str, ...]
) -> None:
    for config in (
        session_config(ZenohOptions(), mode),
        session_config(ZenohOptions(mode=mode), "client"),
    ):
        assert (config.mode, config.connect, config.listen) == (mode, connect, listen)
        zenoh_config = config.make()
        assert json.loads(zenoh_config.get_json("mode")) == mode
        assert json.loads(zenoh_config.get_json("connect/endpoints")) == list(connect)
        assert json.loads(zenoh_config.get_json("listen/endpoints")) == list(listen)
        assert json.loads(zenoh_config.get_json("scouting/multicast/enabled")) is False


def test_the_defaults_are_ours() -> None:
    options = ZenohOptions()
    assert setting(options, "transport/shared_memory/enabled") is False
    assert setting(options, "transport/link/tx/lease") == 2000
    assert setting(options, "transport/unicast/max_sessions") == 10_000
    retry = setting(options, "connect/retry")
    assert (retry["period_init_ms"], retry["period_max_ms"]) == (100, 500)


@pytest.mark.parametrize(("mode", "gossip"), [("router", False), ("client", False), ("peer", None)])
def test_only_peers_gossip(mode: Mode, gossip: bool | None) -> None:  # noqa: FBT001
    assert setting(ZenohOptions(), "scouting/gossip/enabled", mode) is gossip


def test_the_file_overrides_defaults_and_inline_the_file_and_names_both(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(
        """// a comment
        { mode: 'peer', listen: { endpoints: ['tcp/127.0.0.1:1', ], },
          connect: { retry: null },
          transport: { link: { tx: { lease: 10000 } }, unicast: { max_sessions: 7 } },
        }"""
    )
    options = ZenohOptions(config_file=str(file))
    assert setting(options, "mode") == "peer"
    assert setting(options, "transport/link/tx/lease") == 10_000  # which is Zenoh's own default
    assert setting(options, "transport/shared_memory/enabled") is False
    assert setting(options, "connect/retry")["period_init_ms"] == 100  # null is "not given"
    inline = {"transport": {"unicast": {"max_sessions": 8}}, "mode": "client"}
    options = ZenohOptions(config_file=str(file), config=inline, listen=("tcp/127.0.0.1:2",))
    assert setting(options, "transport/unicast/max_sessions") == 8
    assert setting(options, "transport/link/tx/lease") == 10_000
    assert setting(options, "mode") == "client"
    assert setting(options, "listen/endpoints") == ["tcp/127.0.0.1:2"]


def test_endpoints_by_mode_are_understood() -> None:
    by_mode = {"listen": {"endpoints": {"router": ["tcp/127.0.0.1:5"], "peer": []}}}
    options = ZenohOptions(config=by_mode)
    assert session_config(options, "router").listen == ("tcp/127.0.0.1:5",)
    assert session_config(options, "peer").listen == ("tcp/127.0.0.1:0",)


def test_credentials_go_where_zenoh_keeps_them(tmp_path: Path) -> None:
    for name in ("ca", "cert", "key", "users"):
        (tmp_path / name).write_text("")
    tls = TlsOptions(*(str(tmp_path / name) for name in ("ca", "cert", "key")))
    options = ZenohOptions(
        user="robot",
        password="secret",  # noqa: S106
        users_file=str(tmp_path / "users"),
        tls=tls,
    )
    assert setting(options, "transport/auth/usrpwd") == {
        "user": "robot",
        "password": "secret",
        "dictionary_file": str(tmp_path / "users"),
    }
    found = setting(options, "transport/link/tls")
    assert found["root_ca_certificate"] == tls.ca
    assert found["listen_certificate"] == found["connect_certificate"] == tls.certificate
    assert found["listen_private_key"] == found["connect_private_key"] == tls.key
    assert found["enable_mtls"] is True


def test_without_all_three_papers_there_is_no_mutual_proof(tmp_path: Path) -> None:
    for name in ("ca", "cert", "key"):
        (tmp_path / name).write_text("")
    only_ca = TlsOptions(ca=str(tmp_path / "ca"))
    assert setting(ZenohOptions(tls=only_ca), "transport/link/tls/enable_mtls") is None
    only_own = TlsOptions(certificate=str(tmp_path / "cert"), key=str(tmp_path / "key"))
    assert setting(ZenohOptions(tls=only_own), "transport/link/tls/enable_mtls") is None


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"moode": "router"}, "config: Zenoh refuses it: unknown field `moode`"),
        ({"mode": "ruter"}, "config: Zenoh refuses it: unknown variant `ruter`"),
        ({"listen": 3}, "config: Zenoh refuses it"),
        ({"id": object()}, "config: not what JSON can hold"),
        (
            {"transport": {"link": {"tls": {"root_ca_certificate": "/no/such/file"}}}},
            "tls/root_ca_certificate: '/no/such/file' cannot be read: No such file",
        ),
    ],
)
def test_what_zenoh_cannot_use_is_refused_before_anything_is_opened(
    config: dict[str, Any], said: str
) -> None:
    with pytest.raises(ConfigError, match=said):
        session_config(ZenohOptions(config=config), "router")


def test_a_file_that_is_none_or_no_configuration_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    options = ZenohOptions(config_file=str(file))
    with pytest.raises(ConfigError, match=r"config_file: .* cannot be read: No such file"):
        session_config(options, "router")
    for bad, said in (("{mode:", "expected"), ("{mode: 'server'}", "unknown variant `server`")):
        file.write_text(bad)
        with pytest.raises(ConfigError, match=f"(?s)config_file: .* JSON5: .*{said}"):
            session_config(options, "router")
    file.write_bytes(b"\xff")
    with pytest.raises(ConfigError, match=r"config_file: .* cannot be read: it is not UTF-8"):
        session_config(options, "router")
    for not_an_object in ("[]", "7", "null"):
        file.write_text(not_an_object)
        with pytest.raises(ConfigError, match="config_file: "):
            session_config(options, "router")


def test_zenohs_words_are_given_without_the_places_in_its_source() -> None:
    with pytest.raises(zenoh.ZError) as error:
        zenoh.Config.from_file("/no/such/file.json5")
    assert reason(error.value) == "No such file or directory (os error 2)"
