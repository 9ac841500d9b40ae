"""The receiving half of an adapter."""

from __future__ import annotations

from typing import Protocol

from beacon_core.ports.health import Health
from beacon_core.ports.sink import HintSink

__all__ = ["HintSource"]


class HintSource(Protocol):
    """Listens on a carrier and hands everything it hears to a sink.

    Thread rule: ``start`` and ``close`` from one thread (``close`` also from another than
    ``start``); ``health`` from any. The sink is called from threads of the source's choosing.

    What a source promises: messages of one announcer arrive in the order sent, unless the carrier
    itself reorders. What it does not promise: that nothing is lost or repeated.
    """

    def start(self, sink: HintSink) -> None:
        """Begin to listen. Returns once listening, or once it keeps trying in the background.

        A sink does not raise; one that does all the same must not end the source.

        Raises :class:`beacon_core.errors.UsageError` for a second start or one after ``close``, and
        :class:`beacon_core.errors.ConfigError` for what no amount of trying can mend.
        """

    def close(self) -> None:
        """Stop. Idempotent, within 1 s, from any thread.

        After it returned the sink is not called any more. A sink call in progress is waited for,
        unless ``close`` is called from within it.
        """

    def health(self) -> Health:
        """How it is doing; never raises, also before ``start`` and after ``close``."""
