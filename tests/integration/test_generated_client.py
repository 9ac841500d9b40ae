"""The Python client that openapi-python-client makes of our own document reads everything."""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from types import ModuleType
from typing import Any

import attrs
import httpx
import pytest

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_fake import FakeAnnouncer, FakeNetwork, share_network, unshare_network
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer

pytestmark = pytest.mark.system

KNOWN: dict[str, Any] = {
    "areas": [{"id": "hall"}],
    "components": [{"id": "ecu"}],
    "apps": [{"id": "planner", "name": "Planner", "component_id": "ecu"}, {"id": "quiet"}],
    "functions": [{"id": "drive", "hosts": ["planner"]}],
}

COLLECTIONS = {
    "app_id": "list_apps",
    "component_id": "list_components",
    "area_id": "list_areas",
    "function_id": "list_functions",
}


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    """A gateway that has heard of some of those it knows, and of one more."""
    network = FakeNetwork(ManualClock())
    share_network(network, "generated-client")
    source: dict[str, Any] = {"adapter": "fake", "ttl_s": 1000.0, "expiry_s": 10000.0}
    source["options"] = {"network": "generated-client"}
    gateway = Gateway(parse_config({"sources": {"robots": source}, "entities": KNOWN}).config)
    gateway.start()
    for entity_id in ("planner", "ecu", "lidar"):
        hint = BeaconHint(
            entity_id,
            hostname="h",
            process_id=7,
            depends_on=("quiet",),
            function_ids=("drive",),
            metadata={"firmware": "1"},
        )
        FakeAnnouncer(network, entity_id).announce(hint)
    network.run_until_idle()
    with closing(HttpServer("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=server.serve, args=(create_app(gateway),))
        thread.start()
        yield server.url
        server.stop()
        thread.join(10)
    gateway.close()
    unshare_network("generated-client")


@pytest.fixture(scope="module")
def generated(url: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The client as a package called ``made_client``, where it can be imported from."""
    folder = tmp_path_factory.mktemp("client")
    document = folder / "openapi.json"
    document.write_text(httpx.get(f"{url}/api/v1/docs").text)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "openapi_python_client", "generate", "--meta", "none"),
            *("--path", str(document), "--output-path", str(folder / "made_client")),
        ],
        capture_output=True,
        encoding="utf-8",
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "warning" not in done.stdout.lower(), done.stdout
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))


@attrs.frozen
class Operation:
    """One function of the client."""

    name: str
    module: ModuleType

    @property
    def wants(self) -> list[str]:
        """What it must be given besides the client."""
        parameters = inspect.signature(self.module.sync_detailed).parameters.values()
        return [one.name for one in parameters if one.default is one.empty and one.name != "client"]

    def read(self, client: Any, **given: str) -> Any:
        """The answer as the client's own class, which must have parsed it."""
        response = self.module.sync_detailed(client=client, **given)
        assert response.status_code == httpx.codes.OK, (self.name, given, response.content)
        assert type(response.parsed).__name__ not in ("NoneType", "GenericError"), self.name
        # What it has parsed says the same as what was answered.
        assert without_null(response.parsed.to_dict()) == json.loads(response.content)
        return response.parsed


def without_null(body: Any) -> Any:
    if isinstance(body, dict):
        return {key: without_null(value) for key, value in body.items() if value is not None}
    return [without_null(one) for one in body] if isinstance(body, list) else body


@pytest.fixture(scope="module")
def operations(generated: Path) -> dict[str, Operation]:
    """All that read, by name; streams are for other clients."""
    del generated
    api = importlib.import_module("made_client.api")
    found: dict[str, Operation] = {}
    for one in pkgutil.walk_packages(api.__path__, "made_client.api."):
        name = one.name.rpartition(".")[2]
        if not one.ispkg and name.startswith(("get_", "list_")):
            found[name] = Operation(name, importlib.import_module(one.name))
    return found


@pytest.fixture
def client(url: str, operations: dict[str, Operation]) -> Iterator[Any]:
    del operations
    with importlib.import_module("made_client").Client(base_url=f"{url}/api/v1") as made:
        yield made


def test_it_lists_and_reads_everything(client: Any, operations: dict[str, Operation]) -> None:
    ids = {
        parameter: [item.id for item in operations[listing].read(client).items]
        for parameter, listing in COLLECTIONS.items()
    }
    assert {"planner", "quiet", "lidar"} <= set(ids["app_id"])
    read: set[str] = set()
    for name, operation in operations.items():
        if operation.wants == []:
            operation.read(client)
            read.add(name)
        for parameter, known in ids.items():
            if operation.wants == [parameter] and not name.endswith("_beacon"):
                for entity_id in known:
                    operation.read(client, **{parameter: entity_id})
                    read.add(name)
    left = operations.keys() - read
    assert left == {
        *("get_app_beacon", "get_component_beacon"),
        *(f"get_{kind}_data_item" for kind in ("app", "component", "area", "function")),
        *(f"get_{kind}_subscription" for kind in ("app", "component", "function")),
    }


def test_it_reads_beacons_and_their_fields(client: Any, operations: dict[str, Operation]) -> None:
    beacon = operations["get_app_beacon"].read(client, app_id="lidar")
    assert (beacon.hostname, beacon.process_id) == ("h", 7)
    assert beacon.metadata.to_dict() == {"firmware": "1"}
    assert beacon.sources[0].source == "robots"
    assert operations["get_component_beacon"].read(client, component_id="ecu").status == "active"
    value = operations["get_app_data_item"].read(client, app_id="lidar", data_id="hostname")
    assert value.to_dict()["value"] == "h"


def test_it_reads_an_error(client: Any, operations: dict[str, Operation]) -> None:
    response = operations["get_app"].module.sync_detailed(client=client, app_id="nobody")
    assert response.status_code == httpx.codes.NOT_FOUND
    assert response.parsed.error_code == "entity-not-found"


def test_it_subscribes(client: Any, operations: dict[str, Operation]) -> None:
    create = importlib.import_module("made_client.api.subscriptions.create_app_subscription")
    models = importlib.import_module("made_client.models")
    made = create.sync(
        client=client,
        app_id="lidar",
        body=models.CyclicSubscriptionCreateRequest(
            resource="/api/v1/apps/lidar/x-medkit-beacon", interval="slow", duration=60
        ),
    )
    assert made.protocol == "sse"
    reading = operations["get_app_subscription"]
    assert reading.read(client, app_id="lidar", subscription_id=made.id) == made
