"""Who has the last word on what: the table by which layers of the tree are merged, as data.

The fields of an entity come in groups. For each group a layer is AUTHORITATIVE, an ENRICHMENT or a
FALLBACK; :mod:`.merge` says what follows from that. The table is ros2_medkit's (there is no row for
its live data, which these entities do not have), with one group of our own: who takes part in a
function is a membership. There a manifest's list of hosts is final, and so a beacon can never join
a function; here it does.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeAlias

import attrs

from beacon_gateway.tree.entities import App, Area, Component, Entity, Function

__all__ = [
    "BEACONS",
    "DEMOTED",
    "FIELDS",
    "HOST",
    "MANIFEST",
    "RUNTIME",
    "UPSTREAM_FIELDS",
    "Field",
    "Group",
    "Policies",
    "Policy",
    "Rule",
]


class Policy(enum.IntEnum):
    """How much a layer's word counts; the higher wins."""

    FALLBACK = 0
    ENRICHMENT = 1
    AUTHORITATIVE = 2


class Group(enum.StrEnum):
    """Fields that are decided on together."""

    IDENTITY = "identity"
    HIERARCHY = "hierarchy"
    MEMBERSHIP = "membership"
    STATUS = "status"
    METADATA = "metadata"


class Rule(enum.Enum):
    """How two values of one field become one; "empty" is "not said"."""

    SCALAR = enum.auto()
    """The winner's, if it has one; otherwise the other's."""
    LIST = enum.auto()
    """The winner's; of equals, both lists."""
    MAPPING = enum.auto()
    """Key by key as SCALAR."""
    FLAG = enum.auto()
    """The winner's; of equals, whether either says so."""
    GIVEN = enum.auto()
    """The winner's if it is given, or of equals the one that is given; else it stays."""
    FIRST = enum.auto()
    """The first that was said, whoever wins."""


@attrs.frozen
class Field:
    """How one field of an entity is merged."""

    name: str
    group: Group
    rule: Rule


Policies: TypeAlias = Mapping[Group, Policy]
"""A layer's row of the table."""

_A, _E, _F = Policy.AUTHORITATIVE, Policy.ENRICHMENT, Policy.FALLBACK


def _row(
    identity: Policy, hierarchy: Policy, membership: Policy, status: Policy, metadata: Policy
) -> Policies:
    values = (identity, hierarchy, membership, status, metadata)
    return MappingProxyType(dict(zip(Group, values, strict=True)))


#                identity, hierarchy, membership, status, metadata
MANIFEST = _row(_A, _A, _E, _F, _A)
"""What was written down."""
RUNTIME = _row(_F, _F, _F, _A, _E)
"""The ROS graph."""
BEACONS = _row(_E, _E, _E, _E, _E)
"""What each says of itself."""
HOST = _row(_F, _F, _F, _F, _F)
"""The gateway's own host: anybody knows better."""
DEMOTED = HOST
"""A manifest that says ``allow_manifest_override: false``."""

_ID, _HI, _ST, _ME = Group.IDENTITY, Group.HIERARCHY, Group.STATUS, Group.METADATA

_COMMON = (
    Field("name", _ID, Rule.SCALAR),
    Field("translation_id", _ID, Rule.SCALAR),
    Field("description", _ID, Rule.SCALAR),
    Field("tags", _ID, Rule.LIST),
    Field("source", _ME, Rule.FIRST),
)


FIELDS: Mapping[type[Entity], tuple[Field, ...]] = MappingProxyType(
    {
        Area: (
            *_COMMON,
            Field("namespace", _HI, Rule.SCALAR),
            Field("parent_area_id", _HI, Rule.SCALAR),
        ),
        Component: (
            *_COMMON,
            Field("type", _ID, Rule.SCALAR),
            Field("identity", _ID, Rule.MAPPING),
            Field("namespace", _HI, Rule.SCALAR),
            Field("fqn", _HI, Rule.SCALAR),
            Field("area", _HI, Rule.SCALAR),
            Field("parent_component_id", _HI, Rule.SCALAR),
            Field("depends_on", _HI, Rule.LIST),
            Field("variant", _ME, Rule.SCALAR),
            Field("external", _ME, Rule.SCALAR),
        ),
        App: (
            *_COMMON,
            Field("component_id", _HI, Rule.SCALAR),
            Field("depends_on", _HI, Rule.LIST),
            Field("is_online", _ST, Rule.FLAG),
            Field("bound_fqn", _ST, Rule.GIVEN),
            Field("ros_binding", _ME, Rule.GIVEN),
            Field("external", _ME, Rule.SCALAR),
        ),
        Function: (
            *_COMMON,
            Field("hosts", Group.MEMBERSHIP, Rule.LIST),
            Field("depends_on", _HI, Rule.LIST),
        ),
    }
)
"""Every field of every kind but the id."""

UPSTREAM_FIELDS: Mapping[type[Entity], tuple[Field, ...]] = MappingProxyType(
    {
        kind: tuple(
            attrs.evolve(field, group=_HI) if field.group is Group.MEMBERSHIP else field
            for field in fields
        )
        for kind, fields in FIELDS.items()
    }
)
"""The same as ros2_medkit has it: who takes part in a function is hierarchy like any other."""
