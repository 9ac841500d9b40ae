"""Ids and names in documents: attrs validators that say what they may be."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from beacon_core.validator import is_valid_id

__all__ = ["an_id", "an_id_or_empty", "ids", "named"]


def an_id(_: object, __: object, value: str) -> None:
    """An attrs validator: the value is an id."""
    if not is_valid_id(value):
        raise ValueError(
            f"found {ascii(value)[:60]}; give an id: 1 to 256 characters of A-Z a-z 0-9 _ -"
        )


def an_id_or_empty(instance: object, attribute: object, value: str) -> None:
    """The same, or nothing."""
    if value:
        an_id(instance, attribute, value)


def ids(instance: object, attribute: object, value: tuple[str, ...]) -> None:
    """The same, for each of them."""
    for entry in value:
        an_id(instance, attribute, entry)


def named(word: str, none: str) -> Callable[[object, object, Mapping[str, object]], None]:
    """A validator of things by name: ``word`` says what one is, ``none`` that there is none."""

    def check(_: object, __: object, value: Mapping[str, object]) -> None:
        if not value:
            raise ValueError(none)
        for name in value:
            if not is_valid_id(name):
                raise ValueError(
                    f"found {word} named {ascii(name)[:60]}; give a name of A-Z a-z 0-9 _ -"
                )

    return check
