"""The list of all apps: the longest answer there is, and the one that is asked for most.

What a line says changes seldom, but for the age. So each line is kept as bytes, in two pieces with
the age between, for as long as all it follows from is the same. A list of a thousand apps is then
a thousand looks at the stores, and little else.
"""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import orjson

from beacon_gateway.http.blocks import Life
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
    gist: tuple[object, ...]
    before: bytes
    after: bytes
    """Empty if there is no age."""

    def at(self, life: Life, now_ns: int) -> bytes:
        if life.beacon is None:
            return self.before
        age_sec = life.beacon.stored.age_ns(now_ns) / 1e9
        return b"%b%b%b" % (self.before, repr(age_sec).encode(), self.after)


class AppLines:
    """Thread rule: every method may be called from any thread."""

    def __init__(self) -> None:
        self._kept: dict[str, Mapping[str, _Line]] = {}

    def listing(self, asked: Asked) -> object:
        """The collection, as plain data."""
        items = Items.of(asked)
        kept, lines = self._kept.get(asked.base, {}), {}
        written: list[orjson.Fragment] = []
        for app in asked.tree.apps.values():
            life = items.blocks.life(app)
            line = kept.get(app.id)
            if line is None or line.app is not app or line.gist != life.gist:
                line = _line(items, app, life)
            lines[app.id] = line
            written.append(orjson.Fragment(line.at(life, items.blocks.now_ns)))
        self._kept[asked.base] = lines
        return {"items": written, "x-medkit": {"total_count": len(written)}}


def _line(items: Items, app: App, life: Life) -> _Line:
    written = to_json(as_plain(items.app(app, life, _NO_AGE)))
    before, place, after = written.partition(_PLACE)
    return _Line(app, life.gist, before + _KEY if place else before, after)
