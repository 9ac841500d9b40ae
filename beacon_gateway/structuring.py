"""Plain data (as YAML gives it) into frozen attrs classes, with every problem found at once.

cattrs decides which hook a type gets. The hooks here are strict where cattrs would convert
(``"8080"`` is not a number, ``no`` is not a text), and go on after a problem where cattrs and attrs
would stop.

An attrs class may say more about its fields than their types:

* a validator that raises gives a problem at that field;
* ``metadata={"at_least": 0.1}`` lifts a smaller number to that value and reports the correction;
* ``metadata={"ttl_above": True}`` of a source's option is heeded in :mod:`.config`;
* ``metadata={"right": "a port, 0 to 65535"}`` words what would be right.
"""

from __future__ import annotations

import collections.abc
import enum
import math
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import attrs
import cattrs

from beacon_core.errors import BeaconError
from beacon_gateway.problems import DocumentError, Problem, did_you_mean, near, shown, step

__all__ = ["Structurer"]

_T = TypeVar("_T")


class Structurer:
    """Structures one document and collects its problems and corrections, each with its place.

    Thread rule: one thread, one document.
    """

    def __init__(self) -> None:
        self.problems: list[Problem] = []
        self.corrections: list[Problem] = []
        """What was out of range and has been put right."""
        self._path = ["$"]
        self._converter = cattrs.Converter()
        self._register()

    def structure(self, value: object, cls: type[_T]) -> _T:
        """The document as a ``cls``; :class:`DocumentError` says everything that is wrong."""
        with self.at(""):
            result = self.part(value, cls)
        if self.problems:
            raise DocumentError(self.problems)
        return result

    def hook(self, cls: type[_T], hook: Callable[[object], _T]) -> None:
        """Structure ``cls`` with this function; it may use the methods below."""
        self._converter.register_structure_hook(cls, lambda value, _: hook(value))

    def part(self, value: object, cls: type[_T]) -> _T:
        """A part of the document as a ``cls``."""
        return self._converter.structure(value, cls)

    @contextmanager
    def at(self, path_step: str) -> Iterator[None]:
        """Within: problems belong to this place. What ends the block is noted, not raised."""
        self._path.append(path_step)
        try:
            yield
        except _Refused:
            pass
        except (ValueError, TypeError, BeaconError) as error:
            # Some attrs validators put more than their message into the exception.
            message = str(error.args[0] if error.args else error)
            self.note(message.removeprefix(f"{path_step[1:]}: "))
        finally:
            self._path.pop()

    def note(self, message: str) -> None:
        """Something is wrong here."""
        self.problems.append(Problem("".join(self._path), message))

    def correct(self, message: str) -> None:
        """Something was wrong here and has been put right."""
        self.corrections.append(Problem("".join(self._path), message))

    def fields(self, value: object, cls: type[_T]) -> _T:
        """The value as an attrs class, field by field, whatever hook ``cls`` has."""
        # A section with every line commented out holds nothing, and means its defaults.
        given = {} if value is None else self.mapping(value)
        attributes = _attributes(cls)
        before = len(self.problems)
        for key in given:
            if key not in attributes:
                with self.at(step(key)):
                    self.note(f"unknown key{did_you_mean(key, attributes)}{_bare_word(key)}")
        values: dict[str, Any] = {}
        for name, attribute in attributes.items():
            with self.at(step(name)):
                if name in given:
                    values[name] = self._field(given[name], attribute)
                elif attribute.default is attrs.NOTHING:
                    self.note(f"missing; give {_right(attribute)}")
        defaults = {name: at.default for name, at in attributes.items() if name not in given}
        self._validate(values, types.SimpleNamespace(**{**defaults, **values}), attributes)
        self._unless_worse(before, values)
        return cls(**values)

    def mapping(self, value: object, right: str = "keys with values") -> Mapping[Any, object]:
        """The value, which must be a mapping."""
        if isinstance(value, Mapping):
            return value
        raise self._refused(value, right)

    def _field(self, value: object, attribute: attrs.Attribute[Any]) -> Any:
        before = len(self.problems)
        try:
            result = self.part(value, cast("type[Any]", attribute.type))
        except _Refused as refused:
            # The field's own words say more than its type can.
            if refused.whole and "right" in attribute.metadata:
                del self.problems[before:]
                self.note(f"found {shown(value)}; give {_right(attribute)}")
            raise
        least = attribute.metadata.get("at_least")
        if least is None or result >= least:
            return result
        self.correct(f"{result} is too small; using {least}")
        return least

    def _validate(
        self,
        values: Mapping[str, Any],
        instance: types.SimpleNamespace,
        attributes: Mapping[str, attrs.Attribute[Any]],
    ) -> None:
        # attrs would stop at the first problem, so its validators are run here one by one, with a
        # stand-in for the instance. One that misses a refused field there has nothing to say.
        for name, value in values.items():
            validator = attributes[name].validator
            if validator is not None:
                with self.at(step(name)), suppress(AttributeError):
                    validator(instance, attributes[name], value)

    def _refused(self, value: object, right: str) -> _Refused:
        self.note(f"found {shown(value)}; give {right}")
        return _Refused(whole=True)

    def _register(self) -> None:
        for cls in (str, bool, int, float, Path):
            self._converter.register_structure_hook(cls, self._simple)
        hooks: list[tuple[Callable[[Any], bool], Callable[[Any, Any], Any]]] = [
            (lambda cls: attrs.has(typing.get_origin(cls) or cls), self.fields),
            (lambda cls: isinstance(cls, type) and issubclass(cls, enum.Enum), self._enum),
            (lambda cls: typing.get_origin(cls) is Literal, self._literal),
            (lambda cls: typing.get_origin(cls) in _UNIONS, self._union),
            (lambda cls: (typing.get_origin(cls) or cls) in _MAPPINGS, self._values),
            (lambda cls: (typing.get_origin(cls) or cls) in _SEQUENCES, self._items),
        ]
        for applies, hook in hooks:
            self._converter.register_structure_hook_func(applies, hook)

    def _simple(self, value: object, cls: Any) -> Any:
        # cattrs hands a StrEnum to the hook of str.
        if issubclass(cls, enum.Enum):
            return self._enum(value, cls)
        if issubclass(cls, Path):
            return cls(self._text(value))
        structure = {str: self._text, bool: self._bool, int: self._whole, float: self._number}
        return structure[cls](value)

    def _text(self, value: object) -> str:
        if isinstance(value, str):
            return value
        right = "a text" if value is None else f"a text{_bare_word(value) or ', in quotes'}"
        raise self._refused(value, right)

    def _bool(self, value: object) -> bool:
        if isinstance(value, bool):
            return value
        raise self._refused(value, "true or false")

    def _whole(self, value: object) -> int:
        if isinstance(value, int) and not isinstance(value, bool):
            return value
        raise self._refused(value, "a whole number")

    def _number(self, value: object) -> float:
        if isinstance(value, int | float) and not isinstance(value, bool):
            with_limits = _finite(value)
            if with_limits is not None:
                return with_limits
            raise self._refused(value, "a finite number")
        raise self._refused(value, "a number")

    def _enum(self, value: object, cls: type[enum.Enum]) -> enum.Enum:
        return cls(self._one_of(value, [member.value for member in cls]))

    def _literal(self, value: object, cls: Any) -> Any:
        return self._one_of(value, list(typing.get_args(cls)))

    def _one_of(self, value: object, choices: list[Any]) -> Any:
        # True == 1, so the type counts too.
        if any(value == choice and type(value) is type(choice) for choice in choices):
            return value
        known = [str(choice) for choice in choices]
        self.note(f"found {shown(value)}; give one of {', '.join(known)}{near(value, known)}")
        raise _Refused(whole=False)

    def _union(self, value: object, cls: Any) -> Any:
        arms = typing.get_args(cls)
        if value is None and types.NoneType in arms:
            return None
        arms = tuple(arm for arm in arms if arm is not types.NoneType)
        for arm in arms:
            before = len(self.problems)
            try:
                return self.part(value, arm)
            except _Refused as refused:
                # The right kind of value, but something in it is wrong: that is the news.
                if not refused.whole or len(arms) == 1:
                    raise
                del self.problems[before:]
        raise self._refused(value, " or ".join(map(_words, arms)))

    def _values(self, value: object, cls: Any) -> Mapping[str, Any]:
        given = self.mapping(value)
        _, value_type = typing.get_args(cls) or (str, Any)
        before = len(self.problems)
        result: dict[str, Any] = {}
        for key, item in given.items():
            with self.at(step(key)):
                if not isinstance(key, str):
                    self.note(f"this key is not a text{_bare_word(key) or '; put it in quotes'}")
                result[key] = self.part(item, value_type)
        return self._unless_worse(before, result)

    def _items(self, value: object, cls: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise self._refused(value, "a list")
        item_type = (typing.get_args(cls) or (Any,))[0]
        before = len(self.problems)
        items: list[Any] = []
        for index, item in enumerate(value):
            with self.at(step(index)):
                items.append(self.part(item, item_type))
        self._unless_worse(before, items)
        return items if (typing.get_origin(cls) or cls) is list else tuple(items)

    def _unless_worse(self, before: int, result: _T) -> _T:
        if len(self.problems) > before:
            raise _Refused(whole=False)
        return result


class _Refused(Exception):  # noqa: N818 - no error of anybody's: what is wrong has been noted
    """A value cannot be used. ``whole``: because of what it is, not of what is in it."""

    def __init__(self, *, whole: bool) -> None:
        super().__init__()
        self.whole = whole


_UNIONS = (typing.Union, types.UnionType)
_MAPPINGS = (dict, collections.abc.Mapping)
_SEQUENCES = (list, tuple, collections.abc.Sequence)
_WORDS: Mapping[Any, str] = {
    str: "a text",
    Path: "a path",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
}


def _attributes(cls: type[Any]) -> dict[str, attrs.Attribute[Any]]:
    """What may be given, under the names under which it is given."""
    return {field.name: field for field in attrs.fields(attrs.resolve_types(cls)) if field.init}


def _right(attribute: attrs.Attribute[Any]) -> str:
    return str(attribute.metadata.get("right") or _words(attribute.type))


def _words(cls: Any) -> str:
    if cls in _WORDS:
        return _WORDS[cls]
    return "a list" if (typing.get_origin(cls) or cls) in _SEQUENCES else "keys with values"


def _finite(value: float) -> float | None:
    try:
        return float(value) if math.isfinite(value) else None
    except OverflowError:  # a whole number beyond any float
        return None


def _bare_word(value: object) -> str:
    if isinstance(value, bool):
        return " (YAML reads a bare on, off, yes or no as true or false: put it in quotes)"
    return ""
