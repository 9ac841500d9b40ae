"""What can be seen of the nodes: who can be asked, who answers, and what they declare."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import parameter_value_to_python

from beacon_core.parameters.examination import Declared, declarations
from beacon_core.parameters.fields import MAX_PARAMETERS, PREFIX, is_ours
from beacon_core.ports.examination import Finding, Level
from beacon_ros.examine import common_findings, listed, looking, node_findings, visible_nodes
from beacon_ros.graph import node_names
from beacon_ros.spinner import Spinner
from beacon_ros_param.options import RosParamOptions

__all__ = ["examine"]

_ANSWER_S = 4.0
"""Where ``timeout_s`` is longer, an examination does not wait as long as a source would."""

_POLL_S = 0.02
_AGAIN_S = 1.0
_STOP_S = 1.0

_MAX_ASKED = 500
"""Nodes of which parameters are asked. Two clients for each take 230 kB."""


def examine(options: RosParamOptions, seconds: float) -> Iterator[Finding]:
    """Look with a node of our own, and ask each other node as a source would.

    Raises ``ConfigError`` for a domain that cannot be joined.
    """
    with looking(options.domain_id, seconds) as look:
        yield from common_findings(look, options.domain_id)
        nodes = dict(look.until_settled(lambda: tuple(_nodes(look.node, options.targets))))
        yield from node_findings(look, nodes or visible_nodes(look.node))
        if missing := set(options.targets) - nodes.keys():
            what = f"among the targets, but not there: {listed(missing)}"
            yield Finding(Level.PROBLEM, what, "start them, or write them as 'ros2 node list' does")
        askable = [name for name, can_be_asked in nodes.items() if can_be_asked]
        if mute := nodes.keys() - askable:
            what = f"without parameter services, and so not asked: {listed(mute)}"
            yield Finding(Level.NOTE, what, "start_parameter_services is off in such a node")
        if askable:
            within_s = min(options.timeout_s, _ANSWER_S)
            answers = _ask(look.node, askable[:_MAX_ASKED], within_s)
            yield from declarations(answers, within_s)


def _nodes(node: Node, targets: tuple[str, ...]) -> Iterator[tuple[str, bool]]:
    """The targets that are there, or else every node; each with whether it can be asked."""
    everybody = visible_nodes(node)
    for name in [one for one in node_names(node) if one in targets] if targets else everybody:
        space, _, base = name.rpartition("/")
        with suppress(NodeNameNonExistentError):  # it has gone meanwhile
            listing = node.get_service_names_and_types_by_node(base, space or "/")
            services = {service for service, _ in listing}
            yield name, {f"{name}/list_parameters", f"{name}/get_parameters"} <= services


def _ask(node: Node, names: list[str], within_s: float) -> dict[str, Declared | None]:
    """What each declares; ``None``: it did not answer in time."""
    listers = {
        name: node.create_client(ListParameters, f"{name}/list_parameters") for name in names
    }
    getters = {name: node.create_client(GetParameters, f"{name}/get_parameters") for name in names}
    spinner = Spinner(node.context, node)
    try:
        everything = dict.fromkeys(names, ListParameters.Request(prefixes=[PREFIX]))
        lists = _call(listers, everything, within_s)
        ours = {name: _ours(answer) for name, answer in lists.items()}
        wanted = {name: GetParameters.Request(names=some) for name, some in ours.items() if some}
        values = _call(getters, wanted, within_s)
    finally:
        spinner.close(_STOP_S)
    declared: dict[str, Declared | None] = dict.fromkeys(names)
    for name, some in ours.items():
        if not some:
            declared[name] = {}
        elif name in values:
            said = map(parameter_value_to_python, values[name].values)
            declared[name] = dict(zip(some, said, strict=False))
    return declared


def _call(
    clients: Mapping[str, Any], requests: Mapping[str, Any], within_s: float
) -> dict[str, Any]:
    """All at once, and each again that stays silent; the answers of those who answer in time."""
    began = time.monotonic()
    due_s = dict.fromkeys(requests, began)
    sent = {name: list[Any]() for name in requests}
    answers: dict[str, Any] = {}
    while (now := time.monotonic()) < began + within_s and len(answers) < len(requests):
        for name in requests.keys() - answers.keys():
            for future in sent[name]:
                if future.done():
                    answers[name] = future.result()
            # A node that has not found our reader yet drops its answer.
            if now >= due_s[name] and clients[name].service_is_ready():
                sent[name].append(clients[name].call_async(requests[name]))
                due_s[name] = now + _AGAIN_S
        time.sleep(_POLL_S)
    for name, futures in sent.items():
        for future in futures:
            clients[name].remove_pending_request(future)
    return answers


def _ours(answer: Any) -> list[str]:
    return [name for name in answer.result.names if is_ours(name)][:MAX_PARAMETERS]
