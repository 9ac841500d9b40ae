"""The liveliness tokens of which rmw_zenoh's graph is made, both ways.

A node holds one, and one for each of its publishers, subscribers, services and clients::

    @ros2_lv/<domain>/<zid>/<nid>/<nid>/NN/<enclave>/<namespace>/<node>
    @ros2_lv/<domain>/<zid>/<nid>/<id>/MP|MS|SS|SC/<enclave>/<namespace>/<node>/<name>/<type>/<hash>/<qos>

``zid`` is the Zenoh session, ``nid`` numbers its nodes, ``id`` all members of it. Names are mangled
(:mod:`.names`). A session's tokens go when its connection ends, whatever ended it.

A publisher's GID, which stands beside its messages, is the XXH3-128 of its token's key. That is how
a message's sender is known to be the one whose token it is. Others may number their publishers as
they like: see :mod:`.publishers`.
"""

from __future__ import annotations

import enum
import re

import attrs
import xxhash

from beacon_zenoh.rmw import qos
from beacon_zenoh.rmw.keys import MAX_DOMAIN, DataKey
from beacon_zenoh.rmw.names import (
    dds_type,
    is_name,
    is_namespace,
    is_node_name,
    mangled,
    ros_type,
    unmangled,
)
from beacon_zenoh.rmw.qos import DEFAULT_QOS, Qos

__all__ = ["Kind", "Member", "NodeKey", "every_token", "gid_of", "member_of", "token_key"]

_MAX_LENGTH = 2048
"""Longer than four names of 255 with all the rest."""

_HEAD = re.compile(
    r"@ros2_lv/(0|[1-9][0-9]{0,9})/([0-9a-f]{1,32})/([0-9]{1,10})/([0-9]{1,10})/([A-Z]{2})/(.+)"
)
_HASH = re.compile(r"[A-Za-z0-9_]{1,80}")

NodeKey = tuple[int, str, int]
"""Domain, session and number of a node: what is common to all its tokens."""


class Kind(enum.StrEnum):
    """What a token stands for."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIBER = "MS"
    SERVICE = "SS"
    CLIENT = "SC"


@attrs.frozen
class Member:
    """A node, or something that a node has."""

    kind: Kind
    domain: int
    zid: str
    """The Zenoh session, in hexadecimal."""
    node_id: int
    member_id: int
    """Of a node its ``node_id``."""
    node: str
    """Its name without namespace."""
    namespace: str = "/"
    enclave: str = "/"
    name: str = ""
    """The full name of the topic or service."""
    type_name: str = ""
    """Such as ``std_msgs/msg/String``."""
    type_hash: str = ""
    qos: Qos = DEFAULT_QOS

    @property
    def node_key(self) -> NodeKey:
        return self.domain, self.zid, self.node_id

    @property
    def node_name(self) -> str:
        """In full, such as ``/arm/driver``."""
        return f"{self.namespace.rstrip('/')}/{self.node}"

    @property
    def data_key(self) -> DataKey:
        """Of a publisher: what its messages have. Only if it has a topic or service."""
        return DataKey(self.domain, self.name, self.type_name, self.type_hash)


def token_key(member: Member) -> str:
    """The key expression of its token."""
    chunks = [
        "@ros2_lv",
        str(member.domain),
        member.zid,
        str(member.node_id),
        str(member.member_id),
        str(member.kind),
        *map(mangled, (member.enclave, member.namespace, member.node)),
    ]
    if member.kind is not Kind.NODE:
        chunks += [mangled(member.name), dds_type(member.type_name), member.type_hash]
        chunks.append(qos.encode(member.qos))
    return "/".join(chunks)


def every_token(domain: int | None = None) -> str:
    """Matches all tokens of a domain; of all domains."""
    return f"@ros2_lv/{'*' if domain is None else domain}/**"


def gid_of(key: str) -> bytes:
    """How rmw_zenoh numbers the owner of the token with this key."""
    return xxhash.xxh3_128_digest(key.encode("utf-8", "replace"))[::-1]


def member_of(key: str) -> Member | None:
    """Whose token it is; ``None`` if it is not one of rmw_zenoh's. Never raises."""
    found = _HEAD.fullmatch(key) if len(key) <= _MAX_LENGTH else None
    if found is None or found[5] not in _KINDS or int(found[1]) > MAX_DOMAIN:
        return None
    kind, chunks = Kind(found[5]), found[6].split("/")
    if len(chunks) != _CHUNKS[kind]:
        return None
    enclave, namespace, node = map(unmangled, chunks[:3])
    if not (is_namespace(enclave) and is_namespace(namespace) and is_node_name(node)):
        return None
    ids = int(found[1]), found[2], int(found[3]), int(found[4])
    bare = Member(kind, *ids, node, namespace, enclave)
    return bare if kind is Kind.NODE else _with_topic(bare, *chunks[3:])


_KINDS = frozenset(Kind)
_CHUNKS = {kind: 3 if kind is Kind.NODE else 7 for kind in Kind}


def _with_topic(bare: Member, name: str, kind: str, type_hash: str, given: str) -> Member | None:
    full_name, type_name, profile = unmangled(name), ros_type(kind), qos.decode(given)
    if not is_name(full_name) or not _HASH.fullmatch(type_hash):
        return None
    if type_name is None or profile is None:
        return None
    return attrs.evolve(bare, name=full_name, type_name=type_name, type_hash=type_hash, qos=profile)
