"""Embed the core in a gateway of your own: no network, no framework, no thread.

    python examples/embed_in_your_gateway.py

Four objects do it: a store, the intake that fills it, the tree you know, and the provider that
says what the hints add to that tree. All of them may be used from any thread.
"""

from __future__ import annotations

import json

from beacon_core.clock import SystemClock
from beacon_core.entities import App, Component, Entities, Function
from beacon_core.intake import Intake
from beacon_core.provider import BeaconProvider
from beacon_core.store import HintStore
from beacon_core.wire.json import decode

store = HintStore(SystemClock(), ttl_s=10, expiry_s=300)
intake = Intake(store, decode)
provider = BeaconProvider(store)
known = Entities(
    components=[Component("ecu_front", "Front ECU")],
    apps=[App("engine_temp", "Engine temperature"), App("brake_ctl", "Brake control")],
    functions=[Function("thermal", "Thermal management")],
)

# What a carrier of yours would hand in, each message with its sender.
MESSAGES = [
    b'{"entity_id": "engine_temp", "component_id": "ecu_front", "function_ids": ["thermal"]}',
    b'{"entity_id": "ecu_front", "hostname": "robot-7", "metadata": {"firmware": "1.2.3"}}',
    b'{"entity_id": "toaster"}',
    b'{"entity_id": "not an id"}',
    b"not even JSON",
]


def main() -> None:
    print("heard")
    for payload in MESSAGES:
        outcome = intake.offer(payload, source="10.0.0.7")
        print(f"  {outcome.verdict:<10} {outcome.entity_id or outcome.detail}")

    said = provider.introspect(known)  # as often as you like: it costs only what has changed
    print("added to the tree")
    for app in said.new_apps:
        print(f"  app        {known.apps[app.id].name}, hosted by {app.component_id}")
    for component in said.new_components:
        print(f"  component  {known.components[component.id].name}")
    for function in said.new_functions:
        print(f"  function   {function.name}, joined by {', '.join(function.hosts)}")
    print(f"  skipped    {', '.join(said.skipped)}")

    print("metadata")
    for entity_id, metadata in said.metadata.items():
        print(f"  {entity_id}: {json.dumps(metadata)}")

    print("vendor endpoint of engine_temp")
    print(f"  {json.dumps(provider.response('engine_temp'))}")


if __name__ == "__main__":
    main()
