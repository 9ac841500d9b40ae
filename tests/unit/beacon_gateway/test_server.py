"""The HTTP server: its address, and how it stops."""

from __future__ import annotations

import socket
import threading
import time
from contextlib import closing

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route

from beacon_gateway.server import BindError, HttpServer, free_port


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
