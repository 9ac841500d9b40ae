"""The key expressions of rmw_zenoh's data.

=========================================================  =======================================
``<domain>/<topic>/<type>/<hash>``                         PUT: a message
``<domain>/<service>/<type>/<hash>``                       a queryable: the service
``<a topic's key>/@adv/pub/<zid>/<number>/_``              a queryable with what a publisher keeps
                                                           for who comes later, and a token that
                                                           tells of it
=========================================================  =======================================

Topic and service are full names without the first ``/``. The hash is that of the type
(:mod:`beacon_core.wire.rihs01`): who has another definition does not hear us, so to hear everybody
a wildcard stands in its place.
"""

from __future__ import annotations

import re

import attrs

from beacon_zenoh.rmw.names import dds_type, is_name, ros_type

__all__ = [
    "MAX_DOMAIN",
    "DataKey",
    "at_most",
    "data_key",
    "data_key_of",
    "every_hash",
    "kept_by",
    "kept_key",
]

MAX_DOMAIN = 2**32 - 1
"""rmw_zenoh needs no ports, and so knows no limit; this is ours."""

_KEY = re.compile(r"(0|[1-9][0-9]{0,9})(/.+)/([^/]+)/([A-Za-z0-9_]{1,80})")
_MAX_LENGTH = 1024

_DIGITS = 10
"""What has more digits is more than there may be."""


@attrs.frozen
class DataKey:
    """A topic or a service, in one domain, with its type."""

    domain: int
    name: str
    """In full, from ``/`` on."""
    type_name: str
    """Such as ``std_msgs/msg/String``."""
    type_hash: str
    """``RIHS01_`` and 64 digits; of ROS before Iron ``TypeHashNotSupported``."""


def data_key(key: DataKey) -> str:
    """The key expression of a topic or a service."""
    return f"{_of_type(key.domain, key.name, key.type_name)}/{key.type_hash}"


def every_hash(domain: int, name: str, type_name: str) -> str:
    """Matches the topic or service whatever definition others have of its type."""
    return f"{_of_type(domain, name, type_name)}/*"


def data_key_of(key: str) -> DataKey | None:
    """What the key of a message says; ``None`` if it is no such key. Never raises."""
    found = _KEY.fullmatch(key) if len(key) <= _MAX_LENGTH else None
    if found is None:
        return None
    domain, name, type_name = int(found[1]), found[2], ros_type(found[3])
    if domain > MAX_DOMAIN or not is_name(name) or type_name is None:
        return None
    return DataKey(domain, name, type_name, found[4])


def kept_key(topic_key: str, zid: str, number: int) -> str:
    """Where a publisher is asked for what it keeps, and the token that tells of it."""
    return f"{topic_key}/@adv/pub/{zid}/{number}/_"


def kept_by(topic_key: str, zid: str = "") -> str:
    """Matches what all publishers keep, or those of one session. ``_anyke``: the answers have the
    keys of the messages, not that of the question."""
    return f"{topic_key}/@adv/pub/{f'{zid}/' if zid else ''}**?_anyke"


def at_most(wanted: str | None) -> int:
    """How many messages is wanted of what is kept, by the parameter ``_max`` of the question, which
    is the depth of rmw_zenoh's subscribers; 0: all."""
    given = wanted or ""
    return int(given) if given.isascii() and given.isdigit() and len(given) < _DIGITS else 0


def _of_type(domain: int, name: str, type_name: str) -> str:
    return f"{domain}{name}/{dds_type(type_name)}"
