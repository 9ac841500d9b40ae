"""What may be configured about each side, and why the defaults are what they are."""

from __future__ import annotations

import attrs

from beacon_core.errors import ConfigError
from beacon_core.relay.frames import MAX_ENTRIES
from beacon_core.relay.shaping import is_rate

__all__ = [
    "DEFAULT_FORWARDING",
    "DEFAULT_REPUBLISHING",
    "MESSAGE_OVERHEAD_BYTES",
    "Forwarding",
    "Republishing",
]

_MS = 10**6

MESSAGE_OVERHEAD_BYTES = 400
"""What a held message costs besides its payload; empty ones count too."""


@attrs.frozen
class Forwarding:
    """The side that takes messages from its network. Times are nanoseconds."""

    hold_bytes: int = 64 * 1024 * 1024
    """All routes together, with overhead: what can be sent again."""
    message_bytes: int = 16 * 1024 * 1024
    """A larger payload is refused, unseen by the other side."""
    max_routes: int = 1000
    """Routes at a time, those that linger too."""
    max_hops: int = 4
    """Relays a message may have passed; it ends there even if every name map is wrong."""
    digest_ns: int = 1000 * _MS
    """Between digests: so late a lost advertisement is noticed."""
    linger_ns: int = 5000 * _MS
    """How long a closed route's messages can still be asked for."""
    answer_gap_ns: int = 50 * _MS
    """Between two advertisements of one route, and two full digests, whatever is asked."""
    resend_gap_ns: int = 20 * _MS
    """Between two sendings of one content."""
    link_bytes_per_s: float | None = None
    """Of all frames together, a tenth of a second's worth at once; what has no room waits."""

    def __attrs_post_init__(self) -> None:
        if not 1 <= self.max_routes <= MAX_ENTRIES:
            raise ConfigError(
                f"max_routes: {self.max_routes} is not possible; give 1 to {MAX_ENTRIES}"
            )
        if self.link_bytes_per_s is not None and not is_rate(self.link_bytes_per_s):
            raise ConfigError(
                f"link_bytes_per_s: {self.link_bytes_per_s!r} is no rate; give a number above 0"
            )


@attrs.frozen
class Republishing:
    """The side that publishes. Times are nanoseconds."""

    hold_bytes: int = 64 * 1024 * 1024
    """Contents that wait, of all origins together, with overhead."""
    max_origins: int = 16
    """When it is reached, a silent one of which nothing is left gives way to a new one."""
    forget_ns: int = 30_000 * _MS
    """Silent for so long, while there was a link: a forwarder that lives is heard each second."""
    max_routes: int = 1000
    """Of one origin."""
    ask_after_ns: int = 20 * _MS
    """A gap is asked for when it is so old: what is only out of order comes by itself."""
    ask_first_ns: int = 100 * _MS
    """From the first asking to the second; then twice as long each time."""
    ask_most_ns: int = 2000 * _MS
    ask_window: int = 64
    """Missing contents asked for at once, of one route."""
    max_asks: int = 8
    """So often a route that nobody advertises is asked for: over about 10 s."""
    gap_ns: int = 1000 * _MS
    """How long an ordered route may stand still for what is missing."""
    match_ns: int = 500 * _MS
    """How long a new publisher waits for those whom it should match."""
    advertise_delay_ns: int | None = None
    """The original's way: wait exactly so long, whoever matches (it took 3 s)."""
    retry_ns: int = 5000 * _MS
    """Until a publisher that could not be made is tried again."""


DEFAULT_FORWARDING = Forwarding()
"""What applies unless something else is asked for."""

DEFAULT_REPUBLISHING = Republishing()
"""The same."""
