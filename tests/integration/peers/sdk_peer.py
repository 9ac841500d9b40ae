"""A ROS node made by zenoh-ros2-sdk, told what to do by lines of JSON; run with its own Python.

    sdk_peer.py <port of the router> <domain> <folder with definitions>

``["publish", node, qos, hint]`` with a hint as a mapping; ``["subscribe", node, qos, topic]``,
after which each hint that is heard is told as ``{"heard": {...}}``; ``["graph", topic]``;
``["end", node]``. Each is answered with one line.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import Any

sdk: Any = importlib.import_module("zenoh_ros2_sdk")

TOPIC = "/ros2_medkit/discovery"
TYPE = "ros2_medkit_msgs/msg/MedkitDiscoveryHint"
TEXTS = (
    "entity_id",
    "stable_id",
    "display_name",
    "component_id",
    "transport_type",
    "negotiated_format",
    "process_name",
    "hostname",
)


class Peer:
    """What there is of it, by node."""

    def __init__(self, port: int, domain: int, definitions: str) -> None:
        # Before anything else asks for it, since otherwise it would fetch them from GitHub.
        sdk.get_registry(definitions)
        self.where = {"domain_id": domain, "router_ip": "127.0.0.1", "router_port": port}
        session = sdk.ZenohSession.get_instance("127.0.0.1", port)
        for needed in ("builtin_interfaces/msg/Time", "diagnostic_msgs/msg/KeyValue"):
            session.register_message_type(None, needed)
        self.types = session.store.types
        self.made: dict[str, Any] = {}

    def publish(self, node: str, qos: str | None, hint: dict[str, Any]) -> object:
        """Say a hint, from a publisher that is made the first time."""
        if node not in self.made:
            self.made[node] = sdk.ROS2Publisher(
                TOPIC, TYPE, node_name=node, namespace="/fleet/r1", qos=qos, **self.where
            )
        pair = self.types["diagnostic_msgs/msg/KeyValue"]
        sec, nanosec = hint.pop("stamp", (0, 0))
        metadata = [pair(key=key, value=value) for key, value in hint.pop("metadata", {}).items()]
        empty = dict.fromkeys(TEXTS, "")
        fields = {**empty, "function_ids": [], "depends_on": [], "process_id": 0, **hint}
        stamp = self.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        self.made[node].publish(**fields, metadata=metadata, stamp=stamp)
        return "published"

    def subscribe(self, node: str, qos: str | None, topic: str = TOPIC) -> object:
        """Tell what is heard."""
        self.made[node] = sdk.ROS2Subscriber(
            topic, TYPE, tell_heard, node_name=node, namespace="/fleet/r1", qos=qos, **self.where
        )
        return "subscribed"

    def graph(self, topic: str) -> object:
        """Who has to do with a topic, as the SDK sees it."""
        info = sdk.get_topic_info(topic, verbose=True, **self.where)
        if info is None:
            return {"publishers": [], "subscribers": []}
        names = {
            "publishers": [f"{one.node_namespace}|{one.node_name}" for one in info.publishers],
            "subscribers": [f"{one.node_namespace}|{one.node_name}" for one in info.subscribers],
        }
        return {**names, "hashes": sorted({one.type_hash for one in info.publishers})}

    def end(self, node: str) -> object:
        """Take a node down, in order."""
        self.made.pop(node).close()
        return "ended"


def tell_heard(message: Any) -> None:
    """A hint that came."""
    tell(
        {
            "heard": {
                "entity_id": message.entity_id,
                "display_name": message.display_name,
                "depends_on": list(message.depends_on),
                "process_id": message.process_id,
                "metadata": {pair.key: pair.value for pair in message.metadata},
            }
        }
    )


def tell(what: object) -> None:
    """One line."""
    print(json.dumps(what), flush=True)  # noqa: T201 - that is how it answers


def main() -> None:
    """Obey until there is nothing more."""
    peer = Peer(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
    tell({"answer": "ready"})
    for line in sys.stdin:
        verb, *words = json.loads(line)
        tell({"answer": getattr(peer, verb)(*words)})


if __name__ == "__main__":
    main()
