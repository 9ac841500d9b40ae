"""The HTTP server: an address that is taken before anything else is started, then uvicorn."""

from __future__ import annotations

import errno
import resource
import socket
import ssl
from collections.abc import Callable
from types import FrameType

import uvicorn
from starlette.applications import Starlette

from beacon_core.errors import BeaconError
from beacon_gateway.guard import GuardedProtocol

__all__ = ["BindError", "HttpServer", "allow_connections", "free_port"]

_SHUTDOWN_S = 1
"""How long answers under way may take once the server is told to stop."""

_UNREAD_S = 30
"""A client that takes nothing of an answer for so long is cut off by the kernel, and with it one
that is not there any more: a server could not get rid of what it has already handed over."""

_SEND_BUFFER = 256 * 1024
"""What the kernel keeps, twice over, of an answer that is not read. By itself it would keep 4 MB:
8 GB for two thousand streams. At 1 Gbit/s this is enough for a client that is 2 ms away."""

_BACKLOG = 1024
"""Clients that may connect at once, such as a thousand streams after a restart."""


class BindError(BeaconError):
    """The address cannot be had; the message says what to do."""


class HttpServer:
    """Serves one application.

    Thread rule: ``serve`` blocks the thread it is called in; ``stop`` from any thread and from
    signal handlers.
    """

    def __init__(self, host: str, port: int, tls: ssl.SSLContext | None = None) -> None:
        """Takes the address. Port 0 means any free one. Raises :class:`BindError`.

        ``tls``: see :func:`beacon_gateway.tls.server_context`; without, plain HTTP.
        """
        self.tls = tls
        self._socket = _bind(host, port)
        shown_host = f"[{host}]" if ":" in host else host
        scheme = "http" if tls is None else "https"
        self.url = f"{scheme}://{shown_host}:{self._socket.getsockname()[1]}"
        self._server: uvicorn.Server | None = None
        self._stopped = False

    def serve(
        self,
        app: Starlette,
        *,
        at_stop: Callable[[], None] | None = None,
        max_connections: int = 4096,
    ) -> None:
        """Serve until :meth:`stop` (SIGINT and SIGTERM do that too, in the main thread).

        ``at_stop`` is called first of all then: it lets answers end that have no end of their own.
        ``max_connections``: whoever comes beyond is answered 503.
        """
        config = uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            lifespan="off",
            ws="none",
            http=GuardedProtocol,
            limit_concurrency=max_connections,
            timeout_graceful_shutdown=_SHUTDOWN_S,
        )
        config.load()
        config.ssl = self.tls
        self._server = _Server(config, at_stop)
        self._server.should_exit = self._stopped
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """Let ``serve`` return, or not begin. Idempotent."""
        self._stopped = True
        if self._server is not None:
            self._server.should_exit = True

    def close(self) -> None:
        """Give the address back. Idempotent."""
        self._socket.close()


def allow_connections(count: int) -> None:
    """Let this process have so many connections, and as much again for all else, if it may."""
    now, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 2 * count + 1024
    if most != resource.RLIM_INFINITY:
        wanted = min(wanted, most)
    if now != resource.RLIM_INFINITY and now < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def free_port() -> int:
    """A port of this machine that was free a moment ago."""
    with _bind("127.0.0.1", 0) as bound:
        port: int = bound.getsockname()[1]
        return port


class _Server(uvicorn.Server):
    def __init__(self, config: uvicorn.Config, at_stop: Callable[[], None] | None) -> None:
        super().__init__(config)
        self._at_stop = at_stop

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        if self._at_stop is not None:
            self._at_stop()
        await super().shutdown(sockets)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        # uvicorn would raise the signal again when done, and the process would die of it instead
        # of exiting with 0.
        del sig, frame
        self.should_exit = True


def _bind(host: str, port: int) -> socket.socket:
    try:
        family, kind, proto, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (socket.gaierror, UnicodeError) as error:
        raise BindError(f"cannot serve on {host!r}: it is no address of this machine") from error
    bound = socket.socket(family, kind, proto)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNREAD_S * 1000)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        bound.bind(address)
        bound.listen(_BACKLOG)
    except OSError as error:
        bound.close()
        raise BindError(_cannot(host, port, error)) from error
    return bound


def _cannot(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"{host}:{port} is already in use, perhaps by another gateway; "
            "stop that, or serve elsewhere with --port (0 takes any free port)"
        )
    if error.errno == errno.EACCES:
        return f"{host}:{port} needs more rights than this user has; take a port above 1023"
    return f"cannot serve on {host}:{port}: {error.strerror}"
