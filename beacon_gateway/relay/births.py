"""What a core is made of: enough to make the same one again."""

from __future__ import annotations

import attrs

from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.names import NameMap
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.settings import Forwarding, Republishing

__all__ = ["Birth", "ForwarderBirth", "RepublisherBirth"]


@attrs.frozen
class ForwarderBirth:
    """Of the side that takes from the network."""

    origin: int
    epoch: int
    names: NameMap
    settings: Forwarding
    now_ns: int

    def make(self) -> Forwarder:
        """A new one."""
        return Forwarder(
            origin=self.origin,
            epoch=self.epoch,
            names=self.names,
            now_ns=self.now_ns,
            settings=self.settings,
        )


@attrs.frozen
class RepublisherBirth:
    """Of the side that publishes."""

    asker: int
    own: tuple[int, ...]
    settings: Republishing
    now_ns: int

    def make(self) -> Republisher:
        """A new one."""
        return Republisher(
            asker=self.asker, now_ns=self.now_ns, own=self.own, settings=self.settings
        )


Birth = ForwarderBirth | RepublisherBirth
"""Of either."""
