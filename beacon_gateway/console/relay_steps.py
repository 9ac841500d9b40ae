"""One step of a relay's trace as a line of text."""

from __future__ import annotations

from typing import Any

from rich.text import Text

from beacon_core.relay.effects import Arm, Effect, Send
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.frames import Advertisement, Content, Digest, Malformed, Reset, decode
from beacon_gateway.console.terminal import cell
from beacon_gateway.relay.trace import Step

__all__ = ["step_line"]


def step_line(step: Step) -> Text:
    """When, to whom, what; and what was asked for then."""
    effects = [_effect(one) for one in step.effects if not isinstance(one, Arm)]
    answer = f" -> {', '.join(effects)}" if effects else ""
    unlike = "" if step.alike else "  UNLIKE what was recorded"
    return Text.assemble(
        cell(f"{step.at_ns / 1e9:.6f} ", "dim"),
        cell(f"{step.end} {step.core} ", "bold"),
        cell(f"{_call(step)}{answer}"),
        cell(unlike, "bold red"),
    )


def _call(step: Step) -> str:
    if step.method == "frame":
        return f"frame {_frame(*step.args)}"
    return " ".join([step.method, *map(_argument, step.args)])


def _argument(value: Any) -> str:
    if isinstance(value, bytes):
        return f"{len(value)} B"
    if isinstance(value, SeenTopic):
        return f"{value.type.name} {value.qos}"
    return str(value)


def _effect(effect: Effect) -> str:
    if isinstance(effect, Send):
        return f"Send {_frame(effect.header, effect.payload)}"
    payload = getattr(effect, "payload", None)
    if payload is not None:
        return f"Publish {getattr(effect, 'handle', '')} {len(payload)} B"
    return f"{type(effect).__name__} {getattr(effect, 'handle', '')} {getattr(effect, 'topic', '')}"


def _frame(header: bytes, payload: bytes) -> str:
    match decode(header, payload):
        case Content() as one:
            return f"content {one.route}#{one.seq} {len(payload)} B"
        case Advertisement() as one:
            end = " closed" if one.closed else ""
            return f"advertisement {one.route} {one.name} {one.low}..{one.next}{end}"
        case Digest() as one:
            return f"{'full ' if one.full else ''}digest of {len(one.entries)} routes"
        case Reset() as one:
            asked = sum(part.count for part in one.ranges)
            return f"reset hello {one.hello}, {len(one.wanted)} routes, {asked} contents"
        case Malformed() as one:
            return f"no frame: {one.reason}"
    return ""
