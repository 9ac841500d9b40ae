"""Where a gateway may be served, and without what."""

from __future__ import annotations

from pathlib import Path

import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.access.exposure import check_exposure
from beacon_gateway.access.options import AuthConfig, TlsConfig
from beacon_gateway.access.roles import Level
from beacon_gateway.config import HttpConfig

TLS = TlsConfig(Path("cert.pem"), Path("key.pem"))
AUTH = AuthConfig()

EVERYWHERE = ["0.0.0.0", "::", "", "192.0.2.1", "robot.example", "127.0.0.1.example"]  # noqa: S104


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_the_loopback_needs_nothing(host: str) -> None:
    assert check_exposure(HttpConfig(host)) == ""


@pytest.mark.parametrize("host", EVERYWHERE)
def test_anywhere_else_needs_tls_and_authentication(host: str) -> None:
    with pytest.raises(ConfigError) as caught:
        check_exposure(HttpConfig(host))
    assert str(caught.value) == (
        f"$.http.host: serving on {host or 'every address'} needs TLS ($.http.tls) and "
        "authentication for reading ($.http.auth), or a decision to do without: "
        "http.allow_insecure: true, or --allow-insecure"
    )
    assert check_exposure(HttpConfig(host, tls=TLS, auth=AUTH)) == ""


@pytest.mark.parametrize(
    ("http", "missing"),
    [
        (HttpConfig("::", tls=TLS), "authentication"),
        (HttpConfig("::", auth=AUTH), "TLS"),
        (HttpConfig("::", tls=TLS, auth=AuthConfig(Level.WRITE)), "authentication"),
        (HttpConfig("::", tls=TLS, auth=AuthConfig(Level.NONE)), "authentication"),
    ],
)
def test_half_of_it_is_not_enough(http: HttpConfig, missing: str) -> None:
    with pytest.raises(ConfigError, match=missing):
        check_exposure(http)


def test_whoever_decides_to_do_without_is_warned_in_one_sentence() -> None:
    warning = check_exposure(HttpConfig("0.0.0.0", allow_insecure=True, tls=TLS))  # noqa: S104
    assert warning == (
        "serving on 0.0.0.0 without authentication for reading ($.http.auth): "
        "whoever reaches it can read everything"
    )
