"""What quality of service a topic has that several publish, and whom a publisher can reach.

The decisions are those of the relay's ROS topic side, for the same reasons: what stands between two
relays is a topic, whatever middleware either has. Only the depth is told here, by the tokens::

    reliability          reliable if all publishers are
    durability           transient local if all publishers are
    depth, volatile      the largest; of one that keeps all, what is configured
    depth, transient     of all together, since late joiners get that of each; of several rounded up
    local                to a power of two, and never less than before while the topic is durable:
                         a change of it makes a new publisher at the far end
    type                 that of most publishers; among equals the one it had, or the first by name
"""

from __future__ import annotations

from collections.abc import Collection

from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.merging import durable_depth, type_of_most
from beacon_core.relay.values import Qos, TopicType
from beacon_zenoh.rmw import qos as rmw
from beacon_zenoh.rmw.tokens import Member

__all__ = ["merged", "reaches", "rmw_qos", "type_of"]

_BEST_EFFORT = 2
_KEEP_ALL = 2


def type_of(member: Member) -> TopicType:
    """The same, as the relay has it."""
    return TopicType(member.type_name, member.type_hash)


def merged(publishers: Collection[Member], depth: int, before: SeenTopic | None) -> SeenTopic:
    """What the publishers of one topic make of it. There must be one.

    ``depth``: of a topic whose publishers keep all. ``before``: what was told of it before.
    """
    of = type_of_most(map(type_of, publishers), before)
    heard = [one.qos for one in publishers if type_of(one) == of]
    durable = all(one.keeps for one in heard)
    depths = [depth if one.history == _KEEP_ALL else max(one.depth, 1) for one in heard]
    most = durable_depth(depths, before) if durable else max(depths)
    return SeenTopic(of, Qos(all(_reliable(one) for one in heard), durable, most))


def reaches(offered: Qos, of: TopicType, subscription: Member) -> bool:
    """Can a publisher of this type and quality of service have this subscription?

    By the rule of DDS, that it must offer at least what is asked for. rmw_zenoh is more generous;
    but who asks for more than there is must not be waited for.
    """
    wanted = subscription.qos
    return (
        type_of(subscription) == of
        and offered.reliable >= _reliable(wanted)
        and offered.durable >= wanted.keeps
    )


def rmw_qos(qos: Qos) -> rmw.Qos:
    """As it stands in a token."""
    return rmw.Qos(
        reliability=1 if qos.reliable else _BEST_EFFORT,
        durability=1 if qos.durable else 2,
        depth=qos.depth,
    )


def _reliable(qos: rmw.Qos) -> bool:
    return qos.reliability != _BEST_EFFORT
