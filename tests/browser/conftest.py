"""A real gateway on simulated carriers, and a real browser to look at it."""

from __future__ import annotations

import math
import shutil
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from importlib.metadata import entry_points
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import attrs
import jwt
import pytest

from beacon_core.clock import SystemClock
from beacon_core.hint import BeaconHint
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.relaying import (
    CONDUIT_GROUP,
    NETWORK_GROUP,
    ConduitAdapter,
    NetworkAdapter,
)
from beacon_fake import ADAPTER, FakeAnnouncer, FakeNetwork, share_network, unshare_network
from beacon_fake.topic_side import FakeTopics
from beacon_gateway import adapters
from beacon_gateway.access.api_tokens import ApiToken, Identity
from beacon_gateway.access.roles import Role
from beacon_gateway.access.secrets import hash_token, new_token
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer
from beacon_local import CONDUIT as LOCAL

WITHIN_MS = 20_000
"""How long a page may take for anything, on a busy machine."""


@attrs.define
class Stage:
    """A gateway with two sources, ``topic`` and ``zenoh``, and who speaks to it."""

    gateway: Gateway
    networks: dict[str, FakeNetwork]
    server: HttpServer
    thread: threading.Thread | None = None
    announcers: dict[tuple[str, str], FakeAnnouncer] = attrs.field(factory=dict)

    @property
    def url(self) -> str:
        return self.server.url

    def announce(
        self, entity_id: str, *, source: str = "zenoh", robot: str = "r", **fields: Any
    ) -> FakeAnnouncer:
        """Somebody says something, and again each half second."""
        known = self.announcers.get((source, robot))
        if known is None:
            known = FakeAnnouncer(self.networks[source], robot, period_s=0.5)
            self.announcers[source, robot] = known
        known.announce(BeaconHint(entity_id, **fields))
        return known

    def crash(self, robot: str, source: str = "zenoh") -> None:
        announcer = self.announcers.pop((source, robot))
        self.networks[source].crash(announcer.name)

    def serve(self) -> None:
        """Serve, or serve again."""
        port = int(self.server.url.rpartition(":")[2])
        if self.thread is not None:
            self.server = HttpServer("127.0.0.1", port)
        self.gateway.stopping.clear()
        self.thread = threading.Thread(
            target=self.server.serve,
            args=(create_app(self.gateway),),
            kwargs={"at_stop": self.gateway.stopping.set},
        )
        self.thread.start()

    def cut(self) -> None:
        """Serve no more; the gateway goes on."""
        self.server.stop()
        if self.thread is not None:
            self.thread.join(10)
        self.server.close()


@contextmanager
def staged(
    entities: dict[str, Any] | None = None,
    http: dict[str, Any] | None = None,
    more: dict[str, Any] | None = None,
    **settings: Any,
) -> Iterator[Stage]:
    clock, run, stop = SystemClock(), uuid.uuid4().hex, threading.Event()
    networks = {name: FakeNetwork(clock) for name in ("topic", "zenoh")}
    for name, network in networks.items():
        share_network(network, name + run)

    def lookup(name: str) -> Adapter:
        return attrs.evolve(ADAPTER, name=name)

    documents = {
        name: {"adapter": adapter, "options": {"network": name + run}, **settings}
        for name, adapter in (("topic", "ros_topic"), ("zenoh", "zenoh"))
    }
    gateway = Gateway(
        parse_config(
            {
                "sources": documents,
                "entities": entities or {},
                "http": http or {},
                "log_level": "error",
                **(more or {}),
            },
            lookup,
        ).config,
        lookup=lookup,
    )
    gateway.start()

    def drive() -> None:
        while not stop.wait(0.01):
            for network in networks.values():
                network.deliver_due()

    driver = threading.Thread(target=drive)
    driver.start()
    stage = Stage(gateway, networks, HttpServer("127.0.0.1", 0))
    stage.serve()
    try:
        with closing(gateway):
            yield stage
            stage.cut()
    finally:
        stop.set()
        driver.join(10)
        for name in networks:
            unshare_network(name + run)


@pytest.fixture
def stage() -> Iterator[Stage]:
    with staged(ttl_s=3.0, expiry_s=12.0) as made:
        yield made


@pytest.fixture
def expecting_stage() -> Iterator[Stage]:
    """One that knows beforehand of an app ``crane``."""
    entities = {"apps": [{"id": "crane", "name": "Overhead crane"}]}
    with staged(entities, ttl_s=1.0, expiry_s=3.0) as made:
        yield made


@pytest.fixture
def pictured_stage() -> Iterator[Stage]:
    """One where something is missing."""
    entities = {"apps": [{"id": "charger_02", "name": "Charging dock 02"}]}
    with staged(entities, ttl_s=3.0, expiry_s=12.0) as made:
        yield made


@pytest.fixture
def patient_stage() -> Iterator[Stage]:
    """Whose entities stay as they are for as long as a test takes."""
    with staged(ttl_s=300.0, expiry_s=3000.0, source_rate=1e6, global_rate=1e6) as made:
        yield made


@attrs.frozen
class Memory:
    """Which of a test's networks in memory."""

    name: str


@attrs.frozen
class RelayingStage:
    """A gateway that relays from ``robot`` to ``site``."""

    stage: Stage
    robot: FakeTopics
    site: FakeTopics


@pytest.fixture
def relaying_stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RelayingStage]:
    networks = {"robot": FakeTopics(), "site": FakeTopics()}
    registered: dict[str, NetworkAdapter | ConduitAdapter] = {
        NETWORK_GROUP: NetworkAdapter(
            "memory", Memory, lambda one: networks[one.name].side(), lambda one: one.name
        ),
        CONDUIT_GROUP: LOCAL,
    }

    def points(*, group: str) -> Iterable[Any]:
        if group not in registered:
            return entry_points(group=group)
        adapter = registered[group]
        return [SimpleNamespace(name=adapter.name, load=lambda: adapter)]

    monkeypatch.setattr(adapters, "entry_points", points)
    conduit = {"adapter": "local", "options": {"name": uuid.uuid4().hex}}
    ends = {
        name: {
            "network": {"adapter": "memory", "options": {"name": name}},
            "conduit": conduit,
            **does,
        }
        for name, does in (
            ("robot", {"forward": [{"deny": "/secret"}, {"allow": "/**", "to": "/amr_01/**"}]}),
            ("site", {"republish": True}),
        )
    }
    document = {"ends": ends, "state_folder": str(tmp_path)}
    with staged(more={"relay": document}, ttl_s=3.0, expiry_s=12.0) as made:
        yield RelayingStage(made, networks["robot"], networks["site"])


@attrs.frozen
class LockedStage:
    """One that tells strangers nothing."""

    stage: Stage
    token: str
    """Opens it for ever."""
    key: bytes

    def passing_token(self, seconds: float) -> str:
        """Opens it for so long."""
        now_s = int(time.time())
        claims = {
            "iss": "beacon",
            "sub": "a person",
            "role": "viewer",
            "iat": now_s,
            "exp": now_s + math.ceil(seconds),
            "jti": uuid.uuid4().hex,
        }
        return jwt.encode(claims, self.key, "HS256")


@pytest.fixture
def locked_stage(tmp_path: Path) -> Iterator[LockedStage]:
    token, key = new_token(), b"0123456789abcdef0123456789abcdef"
    line = ApiToken(Identity("a-person", Role.VIEWER), hash_token(token).encode()).line()
    (tmp_path / "tokens.txt").write_text(line + "\n")
    (tmp_path / "jwt.secret").write_bytes(key)
    auth = {
        "tokens_file": str(tmp_path / "tokens.txt"),
        "secret_file": str(tmp_path / "jwt.secret"),
    }
    with staged(http={"auth": auth}, ttl_s=3.0, expiry_s=12.0) as made:
        yield LockedStage(made, token, key)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    with playwright.sync_playwright() as tools:
        try:
            started = tools.chromium.launch(executable_path=path, args=["--no-sandbox"])
        except playwright.Error as error:
            pytest.skip(f"no Chromium can be started: {str(error).splitlines()[0]}")
        yield started
        started.close()


@pytest.fixture
def look(browser: Any) -> Iterator[Callable[..., Any]]:
    """Opens a page, and fails if anything goes wrong in it that nobody expected."""
    contexts: list[Any] = []
    faults: list[str] = []

    def open_page(url: str, *, faults_expected: bool = False, **settings: Any) -> Any:
        context = browser.new_context(**{"viewport": {"width": 1440, "height": 900}, **settings})
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(WITHIN_MS)
        if not faults_expected:
            page.on("pageerror", lambda error: faults.append(str(error)))
            page.on(
                "console",
                lambda message: faults.append(message.text) if message.type == "error" else None,
            )
        page.goto(url)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert faults == []


@pytest.fixture
def eventually() -> Callable[[Callable[[], object]], None]:
    def wait(true: Callable[[], object], within_s: float = WITHIN_MS / 1000) -> None:
        deadline = time.monotonic() + within_s
        while not true():
            assert time.monotonic() < deadline, f"not within {within_s} s"
            time.sleep(0.05)

    return wait
