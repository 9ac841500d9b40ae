"""What keeps a client out of an endpoint, told in words, by endpoints that do each of it."""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import pytest

from beacon_zenoh import TlsOptions
from beacon_zenoh.probe import Place, place, why_no_tls, why_unreachable

if TYPE_CHECKING:
    from tests.unit.beacon_zenoh.conftest import Papers

Serve = Callable[[socket.socket], object]


@pytest.mark.parametrize(
    ("endpoint", "found"),
    [
        ("tcp/192.0.2.1:7447", Place("tcp", "192.0.2.1", 7447)),
        (
            "tls/gateway.local:7447#verify_name_on_connect=false",
            Place("tls", "gateway.local", 7447),
        ),
        ("udp/[::1]:1?rel=0", Place("udp", "::1", 1)),
        ("tcp/host", None),
        ("tcp/:7447", None),
        ("tcp/host:", None),
        ("tcp/host:http", None),
        ("tcp/host:٣", None),
        ("unixsock-stream//run/zenoh.sock", None),
    ],
)
def test_where_an_endpoint_is(endpoint: str, found: Place | None) -> None:
    assert place(endpoint) == found


def at(port: int, protocol: str = "tcp", host: str = "127.0.0.1") -> Place:
    return Place(protocol, host, port)


@contextmanager
def serving(serve: Serve, host: str = "127.0.0.1") -> Iterator[int]:
    """A TCP server that does this with each connection; its port."""
    with socket.create_server((host, 0)) as server:

        def run() -> None:
            with suppress(OSError):
                while True:
                    connection, _ = server.accept()
                    with connection, suppress(OSError):
                        connection.settimeout(5)
                        serve(connection)

        thread = threading.Thread(target=run)
        thread.start()
        try:
            yield server.getsockname()[1]
        finally:
            server.shutdown(socket.SHUT_RDWR)
            thread.join(10)


def silent(connection: socket.socket) -> None:
    """Says nothing until the client has gone."""
    while connection.recv(1024):
        pass


def test_somebody_who_listens_can_be_reached() -> None:
    with serving(silent) as port:
        assert why_unreachable(at(port), 2.0) == ""


def test_where_nobody_listens_that_is_the_reason() -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        assert why_unreachable(at(bound.getsockname()[1]), 2.0) == "nobody listens there"


def test_a_name_that_nobody_knows_is_the_reason() -> None:
    why = why_unreachable(at(1, host="no-such-host.invalid"), 2.0)
    assert why == "the name 'no-such-host.invalid' is not known here"


def test_a_place_that_does_not_answer_is_given_up_in_time() -> None:
    with socket.socket() as full:
        full.bind(("127.0.0.1", 0))
        full.listen(0)
        address = full.getsockname()
        # Its line of waiting connections is full after one or two.
        waiting = [socket.socket() for _ in range(3)]
        for one in waiting:
            one.setblocking(False)
            one.connect_ex(address)
        why = why_unreachable(at(address[1]), 0.2)
        for one in waiting:
            one.close()
    assert why == "no answer within 0.2 s: not there, or a firewall in between"


def test_what_the_system_says_otherwise_is_passed_on() -> None:
    why = why_unreachable(at(7447, host="255.255.255.255"), 0.5)
    assert why.startswith("it cannot be reached: ")


def test_what_is_no_stream_cannot_be_tried() -> None:
    assert why_unreachable(at(1, "udp"), 0.1) == ""


def tls(papers: TlsOptions) -> dict[str, Any]:
    """The options as Zenoh names them for a client."""
    return {
        "root_ca_certificate": papers.ca,
        "connect_certificate": papers.certificate or None,
        "connect_private_key": papers.key or None,
    }


def server_of(papers: TlsOptions, then: Serve = silent) -> Serve:
    """Speaks TLS, and wants a certificate of whoever comes."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=papers.ca)
    context.verify_mode = ssl.CERT_REQUIRED
    context.load_cert_chain(papers.certificate, papers.key)

    def serve(connection: socket.socket) -> None:
        with context.wrap_socket(connection, server_side=True) as secure:
            then(secure)

    return serve


def test_with_the_right_papers_nothing_is_wrong(papers: Papers) -> None:
    with serving(server_of(papers.of("gateway"))) as port:
        assert why_no_tls(at(port, "tls"), tls(papers.of("robot")), 2.0) == ""


def test_a_gateway_of_another_authority_is_not_believed(papers: Papers) -> None:
    with serving(server_of(papers.of("gateway"))) as port:
        why = why_no_tls(at(port, "tls"), tls(papers.of("robot", believes="theirs")), 2.0)
    assert why.startswith("its certificate is not believed here: ")


def test_a_gateway_reached_by_another_name_is_not_believed(papers: Papers) -> None:
    with serving(server_of(papers.of("gateway")), "127.0.0.2") as port:
        why = why_no_tls(at(port, "tls", "127.0.0.2"), tls(papers.of("robot")), 2.0)
    assert "not believed here" in why
    assert "127.0.0.2" in why


@pytest.mark.parametrize("signed", ["", "theirs"])
def test_papers_that_the_gateway_does_not_take_are_the_reason(
    papers: Papers, signed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_zenoh.probe._REFUSAL_S", 10.0)
    mine = tls(papers.of("robot", signed=signed or "ours"))
    if not signed:
        del mine["connect_certificate"]
    with serving(server_of(papers.of("gateway"))) as port:
        why = why_no_tls(at(port, "tls"), mine, 2.0)
    assert why.startswith("it does not take this configuration's certificate: ")


def test_papers_that_are_none_are_the_reason(papers: Papers) -> None:
    mine = tls(papers.of("robot")) | {"connect_private_key": __file__}
    why = why_no_tls(at(1, "tls"), mine, 2.0)
    assert why.startswith("the certificates of this configuration cannot be used: ")


def test_somebody_who_speaks_no_tls_is_the_reason(papers: Papers) -> None:
    mine = tls(papers.of("robot"))
    with serving(lambda connection: connection.sendall(b"220 mail.example.com\r\n")) as port:
        assert why_no_tls(at(port, "tls"), mine, 2.0).startswith("no TLS comes about: ")
    with serving(silent) as port:
        assert why_no_tls(at(port, "tls"), mine, 0.2) == "it answers, but not in TLS"
    with serving(lambda _: None) as port:
        assert why_no_tls(at(port, "tls"), mine, 2.0)


def test_somebody_who_hangs_up_when_tls_has_come_about_is_the_reason(papers: Papers) -> None:
    with serving(server_of(papers.of("gateway"), then=lambda _: None)) as port:
        why = why_no_tls(at(port, "tls"), tls(papers.of("robot")), 2.0)
    assert why in (
        "it ended the connection as soon as TLS had come about",
        "no TLS comes about: unexpected eof while reading",
    )


def test_where_nobody_listens_any_more_no_tls_comes_about(papers: Papers) -> None:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        why = why_no_tls(at(bound.getsockname()[1], "tls"), tls(papers.of("robot")), 2.0)
    assert why == "it ended the connection before TLS came about: Connection refused"
