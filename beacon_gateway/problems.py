"""What is wrong with a document: where, what was found, and what would be right."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping

import attrs

from beacon_core.errors import ConfigError

__all__ = ["DocumentError", "Problem", "did_you_mean", "headed", "near", "shown", "step"]

_MAX_SHOWN = 60
"""Characters of a found value in a message: enough to recognise it, and still one line."""


@attrs.frozen
class Problem:
    """One thing that is wrong, and where."""

    path: str
    """Such as ``$.http.port``; ``$`` is the whole document."""
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


class DocumentError(ConfigError):
    """Everything that is wrong; as text one problem per line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


def headed(document: str, error: ConfigError) -> ConfigError:
    """The same error as people should see it: which document, how many problems, then each."""
    if not isinstance(error, DocumentError):
        return error
    count = len(error.problems)
    lines = "".join(f"\n  {problem}" for problem in error.problems)
    return ConfigError(f"{document}: {count} problem{'s' if count > 1 else ''}{lines}")


def step(key: object) -> str:
    """One step of a path: ``.key`` for a field, ``[0]`` for an item, ``['a key']`` where needed."""
    if isinstance(key, str) and key.isascii() and key.replace("-", "_").isidentifier():
        return f".{key}"
    return f"[{_short(ascii(key))}]"


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """``; did you mean 'this'?``, or else what there is to choose from."""
    words = list(known)
    return near(word, words) or f"; possible here: {', '.join(words)}"


def near(word: object, known: Iterable[str]) -> str:
    """``; did you mean 'this'?``, or nothing if nothing is near."""
    nearest = difflib.get_close_matches(str(word).lower(), list(known), n=1)
    return f"; did you mean {nearest[0]!r}?" if nearest else ""


def shown(value: object) -> str:
    """A found value in a few words, on one line, fit for any terminal."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return f"keys ({_short(', '.join(map(ascii, value)))})" if value else "an empty mapping"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    # YAML also has dates and the like.
    kind = {str: "text", int: "number", float: "number"}.get(type(value), type(value).__name__)
    return f"the {kind} {_short(ascii(value) if isinstance(value, str) else str(value))}"


def _short(text: str) -> str:
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 1] + "…"
