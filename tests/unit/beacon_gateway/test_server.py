"""The HTTP server: its address, and how it stops."""

from __future__ import annotations

import asyncio
import datetime as dt
import ipaddress
import resource
import socket
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import httpx
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from beacon_core.errors import ConfigError
from beacon_gateway import guard
from beacon_gateway.access.options import TlsConfig
from beacon_gateway.server import BindError, HttpServer, allow_connections, free_port
from beacon_gateway.tls import renew, server_context


def hello(_: Request) -> PlainTextResponse:
    return PlainTextResponse("hello")


APP = Starlette(routes=[Route("/", hello)])


def test_port_0_takes_a_free_one_and_the_url_says_which() -> None:
    with closing(HttpServer("127.0.0.1", 0)) as server:
        assert server.url.startswith("http://127.0.0.1:")
        thread = threading.Thread(target=server.serve, args=(APP,))
        thread.start()
        assert httpx.get(server.url).text == "hello"
        server.stop()
        thread.join(5)
        assert not thread.is_alive()


def test_an_open_connection_does_not_hold_up_the_end() -> None:
    with closing(HttpServer("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=server.serve, args=(APP,))
        thread.start()
        with (
            httpx.Client() as client,
            socket.create_connection(("127.0.0.1", int(server.url.rpartition(":")[2]))),
        ):
            assert client.get(server.url).text == "hello"
            began = time.monotonic()
            server.stop()
            thread.join(5)
            assert time.monotonic() - began < 3
            assert not thread.is_alive()


def test_who_must_end_answers_is_told_before_they_are_waited_for() -> None:
    asked, stopping = threading.Event(), threading.Event()

    async def until_told(_: Request) -> PlainTextResponse:
        asked.set()
        # The event is of threads: nothing here can wait for it.
        while not stopping.is_set():  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        return PlainTextResponse("ended in order")

    def stop_when_asked(server: HttpServer) -> None:
        assert asked.wait(30)
        server.stop()

    app = Starlette(routes=[Route("/", until_told)])
    with closing(HttpServer("127.0.0.1", 0)) as server:
        serving = threading.Thread(
            target=server.serve, args=(app,), kwargs={"at_stop": stopping.set}
        )
        serving.start()
        stops = threading.Thread(target=stop_when_asked, args=(server,))
        stops.start()
        assert httpx.get(server.url, timeout=60).text == "ended in order"
        serving.join(5)
        stops.join()


def test_room_is_made_for_connections_as_far_as_the_system_allows() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    soft = min(before[1], 1500)
    try:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, before[1]))
        allow_connections(10)
        assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] == soft
        allow_connections(10**9)
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (before[1], before[1])
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_stopped_before_it_serves_it_does_not_serve() -> None:
    with closing(HttpServer("127.0.0.1", 0)) as server:
        server.stop()
        server.serve(APP)


def test_an_ipv6_address_is_written_as_a_url_wants_it() -> None:
    if not socket.has_ipv6:
        pytest.skip("no IPv6 here")
    try:
        server = HttpServer("::1", 0)
    except BindError:
        pytest.skip("no IPv6 loopback here")
    with closing(server):
        assert server.url.startswith("http://[::1]:")


def test_a_port_in_use_is_one_sentence_that_says_what_to_do() -> None:
    with closing(HttpServer("127.0.0.1", 0)) as server:
        port = int(server.url.rpartition(":")[2])
        with pytest.raises(BindError, match=f"^127.0.0.1:{port} is already in use.* --port"):
            HttpServer("127.0.0.1", port)


@pytest.mark.parametrize("host", ["no.such.host.invalid", "a" * 70 + ".example", "256.1.1.1"])
def test_what_is_no_address_is_one_sentence(host: str) -> None:
    with pytest.raises(BindError, match="cannot serve on"):
        HttpServer(host, 0)


def test_somebody_elses_address_is_one_sentence() -> None:
    with pytest.raises(BindError, match=r"^cannot serve on 192\.0\.2\.1:0: "):
        HttpServer("192.0.2.1", 0)


def test_a_port_that_needs_rights_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    # Whoever runs the tests may have those rights.
    monkeypatch.setattr(socket.socket, "bind", refuse)
    with pytest.raises(BindError, match="needs more rights than this user has"):
        HttpServer("127.0.0.1", 80)


def test_a_free_port_can_be_taken() -> None:
    with closing(HttpServer("127.0.0.1", free_port())):
        pass


@contextmanager
def served(tls: ssl.SSLContext | None = None, *, at_most: int = 100) -> Iterator[HttpServer]:
    with closing(HttpServer("127.0.0.1", 0, tls)) as server:
        thread = threading.Thread(
            target=server.serve, args=(APP,), kwargs={"max_connections": at_most}
        )
        thread.start()
        try:
            yield server
        finally:
            server.stop()
            thread.join(5)


def connect(server: HttpServer) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", int(server.url.rpartition(":")[2])), 5)
    client.settimeout(5)
    return client


def everything(client: socket.socket) -> bytes:
    """What the server sends until it closes."""
    said = b""
    while piece := client.recv(65536):
        said += piece
    return said


# TLS


def certificate(folder: Path, name: str = "one") -> TlsConfig:
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
    now = dt.datetime.now(dt.UTC)
    made = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - dt.timedelta(days=1))
        .not_valid_after(now + dt.timedelta(days=1))
        .add_extension(
            x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]), False
        )
        .sign(key, hashes.SHA256())
    )
    config = TlsConfig(folder / "cert.pem", folder / "key.pem")
    config.certificate.write_bytes(made.public_bytes(serialization.Encoding.PEM))
    config.key.write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
    )
    return config


def trusting(config: TlsConfig) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=config.certificate)


def test_with_a_certificate_it_is_https(tmp_path: Path) -> None:
    config = certificate(tmp_path)
    with served(server_context(config)) as server:
        assert server.url.startswith("https://")
        assert httpx.get(server.url, verify=trusting(config)).text == "hello"
        with pytest.raises(httpx.TransportError):
            httpx.get(server.url.replace("https", "http"))


@pytest.mark.parametrize(("least", "spoken"), [("1.2", True), ("1.3", False)])
def test_older_versions_are_spoken_only_if_allowed(
    tmp_path: Path, least: str, *, spoken: bool
) -> None:
    config = certificate(tmp_path)
    config = TlsConfig(config.certificate, config.key, "1.3" if least == "1.3" else "1.2")
    old = trusting(config)
    old.maximum_version = ssl.TLSVersion.TLSv1_2
    with served(server_context(config)) as server:
        if spoken:
            assert httpx.get(server.url, verify=old).text == "hello"
        else:
            with pytest.raises(httpx.ConnectError):
                httpx.get(server.url, verify=old)


def test_a_renewed_certificate_is_shown_to_new_connections(tmp_path: Path) -> None:
    config = certificate(tmp_path)
    before = trusting(config)
    context = server_context(config)
    with served(context) as server:
        with httpx.Client(verify=before) as client:
            assert client.get(server.url).text == "hello"
            renew(context, certificate(tmp_path, "two"))
            assert client.get(server.url).text == "hello", "the old connection goes on"
        assert httpx.get(server.url, verify=trusting(config)).text == "hello"
        with pytest.raises(httpx.ConnectError):
            httpx.get(server.url, verify=before)


def test_files_that_are_no_certificate_and_key_are_one_sentence(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.mkdir()
    other.mkdir()
    mine, foreign = certificate(one), certificate(other)
    with pytest.raises(ConfigError, match=r"^\$.http.tls: .*nowhere: no such file$"):
        server_context(TlsConfig(mine.certificate, tmp_path / "nowhere"))
    with pytest.raises(ConfigError, match="are no certificate and its key"):
        server_context(TlsConfig(mine.certificate, foreign.key))
    locked = ec.generate_private_key(ec.SECP256R1()).private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.BestAvailableEncryption(b"password"),
    )
    mine.key.write_bytes(locked)
    with pytest.raises(ConfigError, match="without a password: the key has a password"):
        server_context(mine)
    mine.key.write_text("no key")
    with pytest.raises(ConfigError, match="are no certificate and its key"):
        server_context(mine)


# clients that do not end what they begin


@pytest.mark.parametrize("begun", [b"", b"\r\n", b"GET / HTTP/1.1\r\nHost: x\r\nX: "])
def test_a_head_that_does_not_come_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch, begun: bytes
) -> None:
    monkeypatch.setattr(guard, "HEAD_WITHIN_S", 0.5)
    with served() as server, connect(server) as client:
        client.sendall(begun)
        assert everything(client).startswith(b"HTTP/1.1 408 ")


def test_neither_is_a_second_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "HEAD_WITHIN_S", 0.5)
    with served() as server, connect(server) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        answer = b""
        while b"hello" not in answer:  # head and body may come one after the other
            piece = client.recv(65536)
            assert piece, answer
            answer += piece
        client.sendall(b"GET / HTT")
        assert everything(client).startswith(b"HTTP/1.1 408 ")


def test_a_head_that_comes_in_time_is_answered_whenever_the_rest_does() -> None:
    with served() as server, connect(server) as client:
        for byte in b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n":
            client.sendall(bytes([byte]))
        assert everything(client).endswith(b"hello")


@pytest.mark.parametrize("way", ["one header", "many headers"])
def test_a_head_without_end_is_cut_off(way: str) -> None:
    with served() as server, connect(server) as client:
        client.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
        piece = b"X" * 1000 if way == "one header" else b"X: %s\r\n" % (b"y" * 992)
        sent, said = 0, b""
        try:
            for _ in range(10_000):
                client.sendall(piece)
                sent += len(piece)
            said = everything(client)
        except ConnectionError:
            pass
        assert sent < 9_000_000
        assert not said or said.split()[1] == b"431"


@pytest.mark.parametrize(
    "nonsense",
    [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"GET\r\n\r\n",
        b"\x00" * 100 + b"\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nZZZ\r\n",
        b"GET / HTTP/1.1\r\nHost: x\r\nA\x00B: c\r\n\r\n",
    ],
)
def test_what_is_no_http_is_refused_and_the_next_one_is_served(nonsense: bytes) -> None:
    with served() as server:
        with connect(server) as client:
            client.sendall(nonsense)
            client.shutdown(socket.SHUT_WR)
            try:
                said = everything(client)
            except ConnectionError:
                said = b""
            assert not said or said.startswith(b"HTTP/1.1 4")
        assert httpx.get(server.url).text == "hello"


def test_whoever_comes_when_it_is_full_is_told_so() -> None:
    with served(at_most=3) as server:
        with connect(server), connect(server), connect(server):
            answer = httpx.get(server.url)
            assert answer.status_code == 503
        deadline = time.monotonic() + 5
        while httpx.get(server.url).status_code != 200:
            assert time.monotonic() < deadline
