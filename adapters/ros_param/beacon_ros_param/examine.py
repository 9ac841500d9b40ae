"""What can be seen of the nodes: who can be asked, who answers, and what they declare."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import islice
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import parameter_value_to_python

from beacon_core.parameters.fields import ENTITY_ID, MAX_PARAMETERS, PREFIX, is_ours, read
from beacon_core.ports.examination import Finding, Level
from beacon_core.validator import is_valid_id
from beacon_ros.examine import common_findings, listed, looking, node_findings, visible_nodes
from beacon_ros.graph import node_names
from beacon_ros.spinner import Spinner
from beacon_ros_param.options import RosParamOptions

__all__ = ["examine"]

_ANSWER_S = 4.0
"""Where ``timeout_s`` is longer, an examination does not wait as long as a source would."""

_POLL_S = 0.02
_STOP_S = 1.0

_MAX_ASKED = 500
"""Nodes of which parameters are asked. Two clients for each take 230 kB."""

_SHOWN = 5
"""Nodes with a fault of a kind that are told one by one."""


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
            yield from _silence(answers, within_s)
            yield from _declarations(answers)


_Declared = Mapping[str, object]
"""A node's parameters that belong to a hint, with their values."""


def _nodes(node: Node, targets: tuple[str, ...]) -> Iterator[tuple[str, bool]]:
    """The targets that are there, or else every node; each with whether it can be asked."""
    everybody = visible_nodes(node)
    for name in [one for one in node_names(node) if one in targets] if targets else everybody:
        space, _, base = name.rpartition("/")
        with suppress(NodeNameNonExistentError):  # it has gone meanwhile
            listing = node.get_service_names_and_types_by_node(base, space or "/")
            services = {service for service, _ in listing}
            yield name, {f"{name}/list_parameters", f"{name}/get_parameters"} <= services


def _ask(node: Node, names: list[str], within_s: float) -> dict[str, _Declared | None]:
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
    declared: dict[str, _Declared | None] = dict.fromkeys(names)
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
    """All at once; the answers of those who answer in time."""
    deadline = time.monotonic() + within_s
    unsent, sent = dict(requests), dict[str, Any]()
    while time.monotonic() < deadline and (unsent or not all(one.done() for one in sent.values())):
        # What is sent before both ends have found each other is never answered.
        for name in [name for name in unsent if clients[name].service_is_ready()]:
            sent[name] = clients[name].call_async(unsent.pop(name))
        time.sleep(_POLL_S)
    answered = {name: future.result() for name, future in sent.items() if future.done()}
    for name in sent.keys() - answered.keys():
        clients[name].remove_pending_request(sent[name])
    return answered


def _ours(answer: Any) -> list[str]:
    return [name for name in answer.result.names if is_ours(name)][:MAX_PARAMETERS]


def _silence(answers: Mapping[str, _Declared | None], within_s: float) -> Iterator[Finding]:
    if silent := [name for name, declared in answers.items() if declared is None]:
        what = f"no answer to list_parameters or get_parameters in {within_s:g} s: {listed(silent)}"
        yield Finding(Level.PROBLEM, what, "they hang, are stopped, or are not spun")


def _declarations(answers: Mapping[str, _Declared | None]) -> Iterator[Finding]:
    speaking = {name: declared for name, declared in answers.items() if declared}
    faults = {name: why for name, declared in speaking.items() if (why := _fault(declared))}
    if well := speaking.keys() - faults.keys():
        said = listed(f"{name} ({speaking[name][ENTITY_ID]})" for name in well)
        yield Finding(Level.OK, f"{PREFIX}.* is declared by {said}")
    for name, why in list(faults.items())[:_SHOWN]:
        what = f"{name} declares {PREFIX}.*, but {why}"
        yield Finding(Level.PROBLEM, what, f"declare {ENTITY_ID} with a text such as 'arm_driver'")
    if len(faults) > _SHOWN:
        yield Finding(Level.PROBLEM, f"so it is with {len(faults) - _SHOWN} more nodes")
    yield from islice(_left_out(speaking), _SHOWN)
    if not speaking and any(declared is not None for declared in answers.values()):
        advice = f"declare {ENTITY_ID} in the node's code or in its params file"
        yield Finding(Level.PROBLEM, f"no node declares {PREFIX}.*", advice)


def _fault(declared: _Declared) -> str:
    """Why this is no hint; ``""`` if it is one."""
    if ENTITY_ID not in declared:
        return "not entity_id among them"
    value = declared[ENTITY_ID]
    if not isinstance(value, str):
        return f"entity_id is no text but {_kind(value)}"
    if not value:
        return "entity_id is empty"
    return "" if is_valid_id(value) else "entity_id is no id: 1 to 256 of A-Z a-z 0-9 _ -"


def _kind(value: object) -> str:
    return "not set" if value is None else f"of type {type(value).__name__}"


def _left_out(speaking: Mapping[str, _Declared]) -> Iterator[Finding]:
    """What cannot be used besides."""
    for name, declared in speaking.items():
        skipped = [line for line in read(declared).skipped if ENTITY_ID not in line]
        if skipped:
            more = f" (and {len(skipped) - 1} more)" if len(skipped) > 1 else ""
            yield Finding(Level.NOTE, f"of {name} is left out: {skipped[0]}{more}")
