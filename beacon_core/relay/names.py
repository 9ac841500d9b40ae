"""Which topics a relay carries, and under which name: ordered rules, and why one applied.

Theory. A pattern is a topic name in which a segment may be ``*``, which stands for one segment, and
the last one ``**``, which stands for one or more. The first rule whose pattern fits decides; a
topic that none fits is denied. An allowing rule may rename: ``to`` has its wildcards where the
pattern has them, in the same order, and each carries over what it stood for.

Loops. Links may form a circle: what one carries over comes back by another. :func:`find_loop` looks
for a name that can pass one and the same rule twice. It follows, through the rules of all links,
not names but the sets of names that patterns describe: what a rule lets out, meets what the next
one lets in. A set that is covered by an earlier rule wholly does not reach a later one; one that is
covered in part is followed as if it did. So no loop is overlooked, and now and then one is reported
that a rule in between would have cut: then make the patterns narrower.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import attrs

from beacon_core.errors import ConfigError
from beacon_core.relay.shaping import UNSHAPED, Shaping
from beacon_core.relay.values import Mode

__all__ = ["Link", "NameMap", "Rule", "Ruling", "find_loop"]

_ANY = ("*", "**")


@attrs.frozen
class Rule:
    """One line of a relay's configuration. ``ConfigError`` if it cannot be understood."""

    allow: bool
    pattern: str
    to: str = ""
    """The name on the other side; empty to keep it."""
    mode: Mode | None = None
    """What is promised for these topics; ``None``: what their quality of service suggests."""
    shaping: Shaping = UNSHAPED
    """Of each of these topics."""

    def __attrs_post_init__(self) -> None:
        wild = [one for one in _segments("pattern", self.pattern) if one in _ANY]
        if not self.allow and self.shaping != UNSHAPED:
            raise ConfigError(f"{self.pattern!r} is denied; leave out how it is to be sent")
        if not self.to:
            return
        if not self.allow:
            raise ConfigError(f"to: {self.to!r} has no use in a rule that denies; leave it out")
        if [one for one in _segments("to", self.to) if one in _ANY] != wild:
            raise ConfigError(
                f"to: {self.to!r} must have the wildcards of the pattern {self.pattern!r},"
                " in the same order"
            )


@attrs.frozen
class Ruling:
    """What becomes of a topic, and why."""

    allowed: bool
    name: str
    """On the other side; empty if denied."""
    rule: int | None
    """Which rule it was, from 0; ``None`` if none fits."""
    reason: str
    mode: Mode | None = None
    shaping: Shaping = UNSHAPED


@attrs.frozen
class NameMap:
    """Ordered rules."""

    rules: tuple[Rule, ...]

    def rule_on(self, name: str) -> Ruling:
        """What becomes of the topic ``name``."""
        parts = tuple(name.strip("/").split("/"))
        for number, rule in enumerate(self.rules):
            caught = _catch(_parts(rule.pattern), parts)
            if caught is not None:
                return _ruling(name, number, rule, caught)
        return Ruling(allowed=False, name="", rule=None, reason="denied: no rule fits")


@attrs.frozen
class Link:
    """A way that messages take: from one network to another."""

    source: str
    target: str
    names: NameMap


def find_loop(links: Sequence[Link]) -> tuple[str, ...] | None:
    """The way of a name that comes back to a rule it has passed, as text; or ``None``."""
    for start, link in enumerate(links):
        for number, rule in enumerate(link.names.rules):
            if rule.allow:
                found = _walk(links, (start, number), _parts(rule.pattern))
                if found is not None:
                    return tuple(_told(links, step) for step in found)
    return None


_Step = tuple[int, int]
_Parts = tuple[str, ...]


def _walk(links: Sequence[Link], first: _Step, names: _Parts) -> list[_Step] | None:
    """Depth first from one rule; each other rule at most once on a way."""
    ways: list[tuple[list[_Step], _Parts]] = [([first], names)]
    while ways:
        way, coming_in = ways.pop()
        at, number = way[-1]
        going_out = _renamed(links[at].names.rules[number], coming_in)
        for step, met in _next_steps(links, links[at].target, going_out):
            if step == first:
                return [*way, step]
            if step not in way:
                ways.append(([*way, step], met))
    return None


def _next_steps(
    links: Sequence[Link], network: str, names: _Parts
) -> Iterable[tuple[_Step, _Parts]]:
    for at, link in enumerate(links):
        if link.source != network:
            continue
        for number, rule in enumerate(link.names.rules):
            pattern = _parts(rule.pattern)
            met = _meet(pattern, names)
            if met is not None and rule.allow:
                yield (at, number), met
            if _catch(pattern, names) is not None:
                break


def _ruling(name: str, number: int, rule: Rule, caught: list[_Parts]) -> Ruling:
    if not rule.allow:
        return Ruling(
            allowed=False, name="", rule=number, reason=f"denied by rule {number}: {rule.pattern}"
        )
    out = "/" + "/".join(_put(_parts(rule.to), caught)) if rule.to else name
    how = f"allowed by rule {number}: {rule.pattern}"
    return Ruling(
        allowed=True,
        name=out,
        rule=number,
        reason=f"{how}, renamed to {out}" if rule.to else how,
        mode=rule.mode,
        shaping=rule.shaping,
    )


def _renamed(rule: Rule, names: _Parts) -> _Parts:
    if not rule.to:
        return names
    # They have met the pattern, so they fit it.
    return _put(_parts(rule.to), _catch(_parts(rule.pattern), names) or [])


def _catch(pattern: _Parts, names: _Parts) -> list[_Parts] | None:
    """What each wildcard stands for, or ``None`` if not all ``names`` fit the pattern."""
    caught: list[_Parts] = []
    for at, part in enumerate(pattern):
        if at >= len(names):
            return None
        if part == "**":
            return [*caught, names[at:]]
        if part == "*":
            if names[at] == "**":
                return None
            caught.append((names[at],))
        elif part != names[at]:
            return None
    return caught if len(names) == len(pattern) else None


def _put(template: _Parts, caught: list[_Parts]) -> _Parts:
    stood_for = iter(caught)
    out: list[str] = []
    for part in template:
        out.extend(next(stood_for) if part in _ANY else (part,))
    return tuple(out)


def _meet(one: _Parts, other: _Parts) -> _Parts | None:
    """The names that fit both, as a pattern; ``None`` if there are none."""
    met: list[str] = []
    at = 0
    while at < len(one) and at < len(other):
        a, b = one[at], other[at]
        if a == "**":
            return (*met, *other[at:])
        if b == "**":
            return (*met, *one[at:])
        if a != b and "*" not in (a, b):
            return None
        met.append(b if a == "*" else a)
        at += 1
    return tuple(met) if len(one) == len(other) else None


def _told(links: Sequence[Link], step: _Step) -> str:
    link = links[step[0]]
    rule = link.names.rules[step[1]]
    to = f" to {rule.to}" if rule.to else ""
    return f"{link.source} -> {link.target}: {rule.pattern}{to}"


def _parts(pattern: str) -> _Parts:
    return tuple(pattern[1:].split("/"))


def _segments(key: str, pattern: str) -> _Parts:
    parts = _parts(pattern)
    wrong = not pattern.startswith("/") or not all(parts) or "**" in parts[:-1]
    if wrong or any("*" in part and part not in _ANY for part in parts):
        raise ConfigError(
            f"{key}: {pattern!r} is no pattern; begin with /, let * be a whole segment and"
            " ** the last one"
        )
    return parts
