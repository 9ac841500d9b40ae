"""schemathesis asks every operation what the OpenAPI document allows, and what it does not."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import closing
from typing import Any

import hypothesis
import pytest
import schemathesis
from schemathesis import GenerationMode
from schemathesis.checks import (
    not_a_server_error,
)
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    negative_data_rejection,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from beacon_core.clock import ManualClock
from beacon_core.hint import BeaconHint
from beacon_fake import FakeAnnouncer, FakeNetwork, share_network, unshare_network
from beacon_gateway.config import parse_config
from beacon_gateway.gateway import Gateway
from beacon_gateway.http import create_app
from beacon_gateway.server import HttpServer

pytestmark = pytest.mark.system

KNOWN: dict[str, Any] = {
    "areas": [{"id": "0"}],
    "components": [{"id": "1"}],
    "apps": [{"id": "2", "component_id": "1"}],
    "functions": [{"id": "3", "hosts": ["2"]}],
}

# That an unsupported method is a 404 is the contract's, and schemathesis would have a 405.
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    negative_data_rejection,
]


@pytest.fixture(scope="module")
def served() -> Iterator[Any]:
    """The schema of a gateway that is served."""
    network = FakeNetwork(ManualClock())
    share_network(network, "schemathesis")
    source: dict[str, Any] = {"adapter": "fake", "ttl_s": 1000.0, "expiry_s": 10000.0}
    source["options"] = {"network": "schemathesis"}
    gateway = Gateway(parse_config({"sources": {"robots": source}, "entities": KNOWN}).config)
    gateway.start()
    for entity_id in ("1", "2"):
        FakeAnnouncer(network, entity_id).announce(BeaconHint(entity_id, hostname="h"))
    network.run_until_idle()
    with closing(HttpServer("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=server.serve, args=(create_app(gateway),))
        thread.start()
        # Streams do not end, so an answer to them is never whole.
        yield schemathesis.openapi.from_url(f"{server.url}/api/v1/docs").exclude(
            operation_id_regex="^stream"
        )
        server.stop()
        thread.join(10)
    gateway.close()
    unshare_network("schemathesis")


# Of each collection one that is there: what is made up seldom is.
THERE = {"area_id": "0", "component_id": "1", "app_id": "2", "function_id": "3"}


def ask(operation: Any, mode: GenerationMode, there: Mapping[str, str]) -> None:
    @hypothesis.given(case=operation.as_strategy(generation_mode=mode))
    @hypothesis.settings(
        max_examples=10,
        deadline=None,
        database=None,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    def promised(case: Any) -> None:
        for name in case.path_parameters.keys() & there.keys():
            case.path_parameters[name] = there[name]
        case.call_and_validate(checks=CHECKS)

    promised()


@pytest.mark.parametrize("there", [{}, THERE], ids=["anybody", "who is there"])
def test_every_answer_is_one_that_the_document_promises(
    served: Any, there: Mapping[str, str]
) -> None:
    asked = 0
    for found in served.get_all_operations():
        ask(found.ok(), GenerationMode.POSITIVE, there)
        asked += 1
    assert asked > 60


def test_what_the_document_does_not_allow_is_refused(served: Any) -> None:
    asked = 0
    for found in served.get_all_operations():
        operation = found.ok()
        if operation.method in ("post", "put") or operation.path.endswith(("/faults", "/logs")):
            ask(operation, GenerationMode.NEGATIVE, THERE)
            asked += 1
    assert asked == 15
