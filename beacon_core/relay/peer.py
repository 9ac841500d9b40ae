"""What a republisher knows of one forwarder, in the life that it has joined.

*Joining* is what makes a new republisher show nothing that was sent before it began. It says hello,
with a number; the forwarder repeats the number in a full digest, beside its own age. So whatever is
not in that digest was sent after the hello. And if the forwarder was younger, when it answered,
than the republisher when it said hello, then all that it has was sent after the republisher began.
Otherwise of each route in the digest only what follows is wanted; of STATE the last ones, too.
"""

from __future__ import annotations

import attrs

from beacon_core.relay.frames import Advertisement, Content, Digest, Entry, fingerprint
from beacon_core.relay.lane import Lane
from beacon_core.relay.track import Track
from beacon_core.relay.values import Mode

__all__ = ["Known", "Peer"]


@attrs.define
class Known:
    """A route that the forwarder has."""

    revision: int
    next: int
    control: int
    """The number of the frame that told of it first."""
    done: bool = False
    """It needs no track any more."""


class Peer:
    """Thread rule: none of its own."""

    def __init__(self, origin: int) -> None:
        self.origin = origin
        self.epoch = -1
        self.heard_ns = 0
        """When anything came of it last, or when the link came up since."""
        self._gone_before = 0
        self.lanes: dict[str, Lane] = {}
        self._begin()

    @property
    def idle(self) -> bool:
        """Nothing of it is published, held, missing or asked for."""
        return not (self.lanes or self.tracks or self.wanted or self.pending)

    def join(self, answer: Digest, said_hello_after_ns: int, gone_before: int = 0) -> None:
        """Begin with another life: ``answer`` is to a hello said so long after we began.

        Of routes up to ``gone_before`` what there was has been published, state too.
        """
        self._begin()
        self._gone_before = gone_before
        self.epoch = answer.epoch
        if answer.age_ns > said_hello_after_ns:
            self._met.update((one.route, one) for one in answer.entries)

    def start_of(self, advertised: Advertisement) -> int:
        """The first content of a route that is wanted."""
        met = self._met.get(advertised.route)
        if met is None:
            return 0
        if advertised.mode is Mode.STATE and advertised.route > self._gone_before:
            return max(met.low, met.next - advertised.qos.depth)
        return met.next

    def learn(self, route: int, revision: int, after: int, control: int) -> Known:
        """The forwarder has this route, and has come so far."""
        known = self.known.get(route)
        if known is None:
            known = self.known[route] = Known(revision, after, control)
        known.revision = max(known.revision, revision)
        known.next = max(known.next, after)
        return known

    def want_if_unlike(self, route: int, revision: int) -> None:
        """Its advertisement is missing, unless the one that came is of this revision."""
        found = self.tracks.get(route)
        if found is None:
            unlike = not self.known[route].done
        else:
            unlike = found[1].advertised.revision < revision
        if unlike:
            self.wanted.setdefault(route, 0)

    def agrees(self, digest: Digest) -> bool:
        """What the digest does not name is what we know."""
        named = {one.route for one in digest.entries}
        others = sorted((n, one) for n, one in self.known.items() if n not in named)
        told = fingerprint((number, one.revision, one.next) for number, one in others)
        return told == digest.fingerprint

    def forget_unnamed(self, digest: Digest) -> list[int]:
        """Drop the routes that a full digest does not name and that are not newer; name them."""
        named = {one.route for one in digest.entries}
        gone = [
            number
            for number, one in self.known.items()
            if number not in named and one.control < digest.control
        ]
        for number in gone:
            del self.known[number]
        self.full_control = digest.control
        for number in self._met.keys() - named:
            del self._met[number]
        return gone

    def _begin(self) -> None:
        self.known: dict[int, Known] = {}
        self.tracks: dict[int, tuple[Lane, Track]] = {}
        self.digest_control = 0
        self.full_control = 0
        self.wanted: dict[int, int] = {}
        # Routes whose advertisement is missing: how often it was asked for.
        self.want_asks = 0
        self.pending: dict[int, list[Content]] = {}
        # By route in wanted.
        self.patient: set[int] = set()
        # Tracks that wait for the advertisements of older routes.
        self.passed: dict[str, int] = {}
        # By name: the newest route that has been let pass.
        self._met: dict[int, Entry] = {}
        # The routes as they were when we came, if they may hold what was sent before.
