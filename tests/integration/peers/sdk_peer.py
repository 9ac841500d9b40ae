"""A ROS node made by zenoh-ros2-sdk, told what to do by lines of JSON; run with its own Python.

    sdk_peer.py <port of the router> <domain> <folder with definitions>

``["publish", node, qos, hint]`` with a hint as a mapping; ``["subscribe", node, qos, topic]``,
after which each hint that is heard is told as ``{"heard": {...}}``; ``["graph", topic]``;
``["declare", node, parameters]``, after which the node can be asked for these texts, and
``["ask", node, prefix]`` for the parameters of another node, by its full name; ``["end", node]``.
Each is answered with one line.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import Any

sdk: Any = importlib.import_module("zenoh_ros2_sdk")
numpy: Any = importlib.import_module("numpy")

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


LIST, GET = "rcl_interfaces/srv/ListParameters", "rcl_interfaces/srv/GetParameters"
DEFINITIONS = {
    LIST: ("string[] prefixes\nuint64 depth", "rcl_interfaces/ListParametersResult result"),
    GET: ("string[] names", "rcl_interfaces/ParameterValue[] values"),
}
HASHES = {
    LIST: "RIHS01_3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
    GET: "RIHS01_bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
}
"""ROS's own: the SDK computes another for services with sequences of messages."""

TEXT = 4
"""Of ``ParameterType``."""


class Peer:
    """What there is of it, by node."""

    def __init__(self, port: int, domain: int, definitions: str) -> None:
        # Before anything else asks for it, since otherwise it would fetch them from GitHub.
        sdk.get_registry(definitions)
        self.where = {"domain_id": domain, "router_ip": "127.0.0.1", "router_port": port}
        session = sdk.ZenohSession.get_instance("127.0.0.1", port)
        for needed in ("builtin_interfaces/msg/Time", "diagnostic_msgs/msg/KeyValue"):
            session.register_message_type(None, needed)
        for needed in ("ListParametersResult", "ParameterValue"):
            session.register_message_type(None, f"rcl_interfaces/msg/{needed}")
        self.session = session
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

    def declare(self, node: str, parameters: dict[str, str]) -> object:
        """Let a node be asked for these."""
        # The SDK gives each service a node of its own; under one number they are one node's.
        number = self.session.get_next_node_id()
        self.session.get_next_node_id = lambda: number
        services: dict[str, Any] = {}

        def lists(request: Any) -> Any:
            found = [
                name
                for name in parameters
                if any(name.startswith(f"{prefix}.") for prefix in request.prefixes)
            ]
            result = self.types["rcl_interfaces/msg/ListParametersResult"]
            return services[LIST].response_msg_class(result=result(names=found, prefixes=[]))

        def gets(request: Any) -> Any:
            values = [self.text(parameters[name]) for name in request.names]
            return services[GET].response_msg_class(values=values)

        for kind, name, answer in ((LIST, "list", lists), (GET, "get", gets)):
            services[kind] = self.service(
                sdk.ROS2ServiceServer, f"/fleet/r1/{node}/{name}_parameters", kind, node, answer
            )
        self.made[node] = Together([*services.values()])
        del self.session.get_next_node_id
        return "declared"

    def ask(self, node: str, prefix: str) -> object:
        """The texts that a node has below this prefix."""
        lister, getter = (
            self.service(sdk.ROS2ServiceClient, f"{node}/{name}_parameters", kind, "asker")
            for kind, name in ((LIST, "list"), (GET, "get"))
        )
        names = list(lister.call(prefixes=[prefix], depth=0).result.names)
        values = getter.call(names=names).values
        Together([lister, getter]).close()
        return {name: one.string_value for name, one in zip(names, values, strict=True)}

    def service(self, end: Any, name: str, kind: str, node: str, *callback: object) -> Any:
        """One end of a service."""
        request, response = DEFINITIONS[kind]
        return end(
            name,
            kind,
            *callback,
            request_definition=request,
            response_definition=response,
            type_hash=HASHES[kind],
            node_name=node,
            namespace="/fleet/r1",
            **self.where,
        )

    def text(self, text: str) -> Any:
        """A value that is this text."""
        numbers = dict.fromkeys(("byte", "bool", "integer", "double"), numpy.array([]))
        kinds = {"byte": "uint8", "bool": "bool", "integer": "int64", "double": "float64"}
        arrays = {
            f"{name}_array_value": array.astype(kinds[name]) for name, array in numbers.items()
        }
        return self.types["rcl_interfaces/msg/ParameterValue"](
            type=TEXT,
            bool_value=False,
            integer_value=0,
            double_value=0.0,
            string_value=text,
            string_array_value=[],
            **arrays,
        )

    def end(self, node: str) -> object:
        """Take a node down, in order."""
        self.made.pop(node).close()
        return "ended"


class Together:
    """Several things that end together."""

    def __init__(self, parts: list[Any]) -> None:
        self.parts = parts

    def close(self) -> None:
        """End them."""
        for part in self.parts:
            part.close()


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
