"""The list of all apps: the longest answer there is, and the one that is asked for most.

What a line says changes seldom, but for the age. So each line is kept as bytes, in two pieces with
the age between, for as long as all it follows from is the same. A list of a thousand apps is then
one look at each store, and little else for each app.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import is_

import attrs
import orjson

from beacon_core.stored import StoredHint
from beacon_gateway.http.items import Items
from beacon_gateway.http.models.base import as_plain
from beacon_gateway.http.operations import Asked
from beacon_gateway.tree.entities import App
from beacon_gateway.writing import to_json

__all__ = ["AppLines"]

_NO_AGE = -1.0
_KEY = b'"age_sec":'
# No text can hold this: there is a backslash before each quote within a text.
_PLACE = _KEY + b"-1.0"


@attrs.frozen
class _Line:
    app: App
    evidence: tuple[object, ...]
    gist: tuple[object, ...]
    heard: StoredHint | None
    before: bytes
    after: bytes
    """Empty if there is no age."""

    def follows_from(self, app: App, evidence: tuple[object, ...]) -> bool:
        """Values never change: the same objects say the same."""
        return self.app is app and all(map(is_, self.evidence, evidence))

    def at(self, now_ns: int) -> bytes:
        if self.heard is None:
            return self.before
        return b"%b%r%b" % (self.before, self.heard.age_ns(now_ns) / 1e9, self.after)


class AppLines:
    """Thread rule: every method may be called from any thread."""

    def __init__(self) -> None:
        self._kept: dict[str, Mapping[str, _Line]] = {}

    def listing(self, asked: Asked) -> object:
        """The collection, as plain data."""
        items = Items.of(asked)
        kept, lines = self._kept.get(asked.base, {}), {}
        written: list[bytes] = []
        for app in asked.tree.apps.values():
            line, evidence = kept.get(app.id), items.blocks.evidence(app)
            # Of who is silent it may be another thing to have never been heard.
            if line is None or line.heard is None or not line.follows_from(app, evidence):
                line = _following(line, items, app, evidence)
            lines[app.id] = line
            written.append(line.at(items.blocks.now_ns))
        self._kept[asked.base] = lines
        whole = orjson.Fragment(b"[%b]" % b",".join(written))
        return {"items": whole, "x-medkit": {"total_count": len(written)}}


def _following(line: _Line | None, items: Items, app: App, evidence: tuple[object, ...]) -> _Line:
    life = items.blocks.life(app)
    heard = None if life.beacon is None else life.beacon.stored
    if line is not None and line.app is app and line.gist == life.gist:
        return _Line(app, evidence, line.gist, heard, line.before, line.after)
    written = to_json(as_plain(items.app(app, life, _NO_AGE)))
    before, place, after = written.partition(_PLACE)
    return _Line(app, evidence, life.gist, heard, before + _KEY if place else before, after)
