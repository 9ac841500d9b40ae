"""The session, the node, and the names of its parts, for sources and announcers alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs

from beacon_core.wire.medkit import TYPE_HASH, TYPE_NAME
from beacon_zenoh.config import SessionConfig, session_config
from beacon_zenoh.options import SessionOptions
from beacon_zenoh.rmw.qos import Qos
from beacon_zenoh.rmw.tokens import Kind, Member

__all__ = ["hint_member", "node_member", "rmw_session_config"]


def rmw_session_config(
    options: SessionOptions, defaults: Mapping[str, Any] | None = None
) -> SessionConfig:
    """Put together what the options say; ``ConfigError``, and ``defaults``, as of
    :func:`beacon_zenoh.config.session_config`.

    Nodes of rmw_zenoh find each other by the gossip of their router. So where we are the router,
    it is on, unless the configuration says otherwise.
    """
    config = session_config(options, "client", defaults)
    if config.mode != "router" or _has_gossip(options.config):
        return config
    scouting = {**config.document["scouting"], "gossip": {"enabled": True}}
    return attrs.evolve(config, document={**config.document, "scouting": scouting})


def node_member(domain: int, zid: str, number: int, name: str) -> Member:
    """A node of ours."""
    return Member(Kind.NODE, domain, zid, number, number, name)


def hint_member(node: Member, kind: Kind, number: int, topic: str, qos: Qos) -> Member:
    """Our publisher or subscriber of hints."""
    return attrs.evolve(
        node,
        kind=kind,
        member_id=number,
        name=topic,
        type_name=TYPE_NAME,
        type_hash=TYPE_HASH,
        qos=qos,
    )


def _has_gossip(config: Mapping[str, object]) -> bool:
    scouting = config.get("scouting")
    return isinstance(scouting, Mapping) and "gossip" in scouting
