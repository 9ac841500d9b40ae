"""An ordinary typed node: ``publish`` or ``listen``, package, message, topic. Tells what it hears.

Its message: the fields that it is given as JSON, in each text field; or for a type with ``data``
just that.
"""

from __future__ import annotations

import importlib
import json
import sys
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile

QOS = QoSProfile(depth=10)


def publish(node: Node, of: type[Any], topic: str, fields: dict[str, Any]) -> None:
    publisher = node.create_publisher(of, topic, QOS)
    message = of(**fields)
    node.create_timer(0.1, lambda: publisher.publish(message))


def listen(node: Node, of: type[Any], topic: str, fields: dict[str, Any]) -> None:
    def tell(message: Any) -> None:
        print(  # noqa: T201 - the test reads it
            json.dumps({name: getattr(message, name) for name in fields}), flush=True
        )

    node.create_subscription(of, topic, tell, QOS)


def main() -> None:
    verb, package, name, topic, fields = sys.argv[1:]
    rclpy.init()
    node = Node(verb)
    of = getattr(importlib.import_module(f"{package}.msg"), name)
    {"publish": publish, "listen": listen}[verb](node, of, topic, json.loads(fields))
    try:
        rclpy.spin(node)
    except BaseException:  # noqa: BLE001 - however it is ended
        return


main()
