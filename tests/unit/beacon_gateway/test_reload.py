"""Another configuration while serving: whole or not at all."""

from __future__ import annotations

import os
import signal
import ssl
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import httpx
import pytest

from beacon_core.errors import ConfigError
from beacon_gateway.access.access import Access
from beacon_gateway.access.api_tokens import ApiToken, Identity
from beacon_gateway.access.options import TlsConfig
from beacon_gateway.access.roles import Role
from beacon_gateway.access.secrets import hash_token
from beacon_gateway.config import Config, Loaded, load_config
from beacon_gateway.console.signals import on_reload_signal
from beacon_gateway.http import create_app
from beacon_gateway.reload import Reload
from beacon_gateway.server import HttpServer
from beacon_gateway.tls import server_context

if TYPE_CHECKING:
    from tests.unit.beacon_gateway.conftest import Plant, PlantMaker

MANIFEST = 'manifest_version: "1.0"\napps:\n  - {{id: {}, name: {}}}\n'


@attrs.frozen
class Running:
    """A gateway that serves, with the file its configuration comes from."""

    plant: Plant
    server: HttpServer
    path: Path
    reload: Reload
    logged: list[Config]

    def get(self, path: str = "/apps", **more: Any) -> httpx.Response:
        return httpx.get(f"{self.server.url}/api/v1{path}", **more)

    def apps(self) -> list[str]:
        # Answers may be a tenth of a second old.
        self.plant.wait(0.2)
        return [item["id"] for item in self.get().json()["items"]]

    def again(self, http: str = "{port: 0}", **more: str) -> bool:
        """Write another file and let it be read."""
        self.rewrite(http, **more)
        return self.reload()

    def rewrite(self, http: str = "{port: 0}", sources: str = "", **more: str) -> None:
        network = self.plant.gateway.config.sources["robots"].options.network
        lines = [f"http: {http}", *(f"{name}: {value}" for name, value in more.items())]
        robots = f"robots: {{adapter: fake, options: {{network: {network}}}}}"
        lines.append(f"sources: {{{robots}{sources}}}")
        self.path.write_text("\n".join(lines))


@pytest.fixture
def running(make_plant: PlantMaker, tmp_path: Path) -> Iterator[Running]:
    plant = make_plant(http={"port": 0})
    plant.announce("lidar")
    access = Access(plant.gateway.config.http)
    path, logged = tmp_path / "gateway.yaml", list[Config]()
    with closing(HttpServer("127.0.0.1", 0)) as server:

        def read() -> Loaded:
            return load_config(path)

        reload = Reload(read, plant.gateway, access, server, logged.append)
        app = create_app(plant.gateway, access)
        thread = threading.Thread(target=server.serve, args=(app,))
        thread.start()
        yield Running(plant, server, path, reload, logged)
        server.stop()
        thread.join(5)


def test_what_can_change_is_taken_over(running: Running) -> None:
    assert running.again(entities="{apps: [{id: planner}]}", vendor_name="Acme", log_level="debug")
    assert set(running.apps()) == {"lidar", "planner"}
    assert running.get("/version-info").json()["items"][0]["vendor_info"]["name"] == "Acme"
    assert [str(one.log_level) for one in running.logged] == ["debug"]
    assert running.get("/apps/lidar/x-medkit-beacon").json()["status"] == "active"


def test_the_manifest_is_read_again(running: Running) -> None:
    manifest = running.path.parent / "manifest.yaml"
    manifest.write_text(MANIFEST.format("one", "One"))
    assert running.again(manifest="manifest.yaml")
    assert set(running.apps()) == {"lidar", "one"}
    manifest.write_text(MANIFEST.format("two", "Two"))
    assert running.reload()
    assert set(running.apps()) == {"lidar", "two"}
    assert running.again()
    assert running.apps() == ["lidar"]


def test_tokens_are_asked_for_from_now_on_and_read_again(running: Running) -> None:
    tokens = running.path.parent / "tokens.txt"

    def line(token: str) -> str:
        return ApiToken(Identity("me", Role.VIEWER), hash_token(token).encode()).line()

    tokens.write_text(line("old"))
    assert running.get().status_code == 200
    assert running.again("{port: 0, auth: {tokens_file: tokens.txt}}")
    assert running.get().status_code == 401
    assert running.get(headers={"authorization": "Bearer old"}).status_code == 200
    tokens.write_text(line("new"))
    assert running.reload()
    assert running.get(headers={"authorization": "Bearer old"}).status_code == 401
    assert running.get(headers={"authorization": "Bearer new"}).status_code == 200


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"log_level": "loud"}, "$.log_level: found the text 'loud'"),
        ({"manifest": "nowhere.yaml"}, "nowhere.yaml: No such file"),
        ({"http": "{port: 0, auth: {tokens_file: nowhere}}"}, "nowhere: No such file"),
        ({"http": "{port: 0, cors: {allowed_origins: [x]}}"}, "$.http.cors.allowed_origins"),
    ],
)
def test_a_bad_one_is_refused_whole_and_said(
    running: Running, caplog: pytest.LogCaptureFixture, changed: dict[str, str], said: str
) -> None:
    assert running.again(vendor_name="Acme")
    assert not running.again(
        **{"vendor_name": "Other", "entities": "{apps: [{id: new}]}", **changed}
    )
    assert "not reloaded, the old configuration stays" in caplog.text
    assert said in caplog.text
    assert running.apps() == ["lidar"]
    assert running.get("/version-info").json()["items"][0]["vendor_info"]["name"] == "Acme"


def test_what_needs_a_restart_is_said_and_stays_while_the_rest_changes(
    running: Running, caplog: pytest.LogCaptureFixture
) -> None:
    before = running.plant.gateway.config
    assert running.again(
        "{port: 81, max_streams: 5}",
        sources=", more: {adapter: fake}",
        allow_new_entities="false",
        vendor_name="Acme",
    )
    said = [one.getMessage() for one in caplog.records if "needs a restart" in one.getMessage()]
    assert [one.split()[0] for one in said] == [
        "$.sources",
        "$.allow_new_entities",
        "$.http.port",
        "$.http.max_streams",
    ]
    after = running.plant.gateway.config
    assert after == attrs.evolve(before, vendor_name="Acme")
    assert running.apps() == ["lidar"]


def test_taking_away_the_tokens_of_an_open_gateway_is_refused(running: Running) -> None:
    gateway = running.plant.gateway
    open_http = attrs.evolve(gateway.config.http, host="0.0.0.0", allow_insecure=True)  # noqa: S104
    gateway.config = attrs.evolve(gateway.config, http=open_http)
    assert running.again("{port: 0, host: 0.0.0.0, allow_insecure: true}")
    assert not running.again("{port: 0, host: 0.0.0.0}")


def certificate(folder: Path) -> None:
    command = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2"
    command += " -subj /CN=x -addext subjectAltName=IP:127.0.0.1 -keyout key.pem -out cert.pem"
    subprocess.run(command.split(), cwd=folder, check=True, capture_output=True)


def test_a_renewed_certificate_is_shown_and_a_bad_one_is_not(
    make_plant: PlantMaker, tmp_path: Path
) -> None:
    certificate(tmp_path)
    tls = TlsConfig(tmp_path / "cert.pem", tmp_path / "key.pem")
    plant = make_plant(http={"tls": {"certificate": str(tls.certificate), "key": str(tls.key)}})
    loaded = Loaded(plant.gateway.config)
    access = Access(loaded.config.http)
    with closing(HttpServer("127.0.0.1", 0, server_context(tls))) as server:
        thread = threading.Thread(target=server.serve, args=(create_app(plant.gateway, access),))
        thread.start()
        reload = Reload(lambda: loaded, plant.gateway, access, server, lambda _: None)

        def shown() -> int:
            trusted = ssl.create_default_context(cafile=tls.certificate)
            return httpx.get(f"{server.url}/livez", verify=trusted).status_code

        assert shown() == 200
        certificate(tmp_path)
        with pytest.raises(httpx.ConnectError):
            shown()
        assert reload()
        assert shown() == 200
        before = tls.certificate.read_bytes()
        tls.certificate.write_text("no certificate")
        assert not reload()
        tls.certificate.write_bytes(before)
        assert shown() == 200
        server.stop()
        thread.join(5)


def test_nodes_to_ask_are_told_to_the_sources(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[frozenset[str] | None] = []
    source: Any = running.plant.gateway.listeners[0].source
    monkeypatch.setattr(type(source), "set_targets", lambda _, nodes: told.append(nodes), False)
    assert running.again(entities="{apps: [{id: a, ros_node: /a}]}")
    assert running.again(entities="{apps: [{id: a, ros_node: /a}]}")
    assert running.again()
    assert told == [frozenset({"/a"}), None]


def eventually(true: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10
    while not true():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.01)


def test_sighup_reloads_each_time_even_after_a_failure() -> None:
    calls: list[int] = []

    def reload() -> None:
        calls.append(1)
        if len(calls) == 1:
            raise ConfigError("a defect")

    before = signal.getsignal(signal.SIGHUP)
    with on_reload_signal(reload):
        for count in (1, 2, 3):
            os.kill(os.getpid(), signal.SIGHUP)
            eventually(lambda count=count: len(calls) == count)  # type: ignore[misc]
    assert signal.getsignal(signal.SIGHUP) is before
