"""What follows from a node's answers, told to a sink.

* an answer with a hint: an offer. What it says was true after the question was asked; so the time
  of the question serves as the number of the message, and the GID as the name of the run. Between
  two answers a hint may have changed, or gone and come back: nobody will know;
* a hint that is gone from an answer, or is about somebody else: goodbye;
* a node that does not answer: nothing. It may be busy; its time to live speaks;
* a node that has left: loss.

An event may tell that a node takes its hint back, and then it is asked, to be sure. If it does not
answer any more, or has left, that was its goodbye.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from beacon_core.outcome import Outcome
from beacon_core.parameters.target import Poll, Target
from beacon_core.ports.sink import HintSink
from beacon_core.token_bucket import TokenBucket

__all__ = ["Teller"]

_log = logging.getLogger(__name__)

_LOG_RATE, _LOG_BURST = 1.0, 20.0
"""Lines per second, and at once, that all nodes together can cause."""


class Teller:
    """Thread rule: one thread, but for ``stop`` and ``counts``: those any."""

    def __init__(self, sink: HintSink, now_ns: int) -> None:
        self.counts = dict.fromkeys(("goodbyes", "lost", "sink-errors"), 0)
        """What was told, and how often the sink raised."""
        self._sink = sink
        self._stopped = False
        self._log_lines = TokenBucket(_LOG_RATE, capacity=_LOG_BURST, now_ns=now_ns)

    def stop(self) -> None:
        """Tell the sink nothing any more."""
        self._stopped = True

    def heard(self, target: Target, poll: Poll, now_ns: int) -> None:
        """It has answered all questions of this poll."""
        if poll.sequence > target.left_ns:
            target.left_ns = 0
        for line in target.learn(poll.values):
            if self._log_lines.try_consume(now_ns):
                _log.warning("%s: left out: %s", target.name, line)
        if target.told_id and target.told_id != target.hint_id:
            self._say_goodbye(target, poll.sequence)
        if not target.payload:
            return
        incarnation, sequence = _number(target, poll.sequence)
        outcome = self._tell(
            lambda: self._sink.offer(
                target.payload, target.name, incarnation=incarnation, sequence=sequence
            )
        )
        if outcome is not None and outcome.entity_id:
            target.told_id = outcome.entity_id

    def unanswered(self, target: Target, now_ns: int) -> None:
        """It did not answer in time."""
        if target.told_id and target.left_ns:
            self._say_goodbye(target, now_ns)

    def left(self, target: Target, reason: str, now_ns: int) -> None:
        """It is not in the graph any more, or it is another run. The reason is for people."""
        if not target.told_id:
            return
        if target.left_ns:
            self._say_goodbye(target, now_ns)
            return
        self.counts["lost"] += 1
        self._tell(
            lambda: self._sink.lost(
                target.told_id, target.name, incarnation=target.incarnation, reason=reason
            )
        )

    def _say_goodbye(self, target: Target, at_ns: int) -> None:
        self.counts["goodbyes"] += 1
        incarnation, sequence = _number(target, at_ns)
        said = self._tell(
            lambda: self._sink.goodbye(
                target.told_id, target.name, incarnation=incarnation, sequence=sequence
            )
        )
        if said is not None:
            target.told_id = ""

    def _tell(self, what: Callable[[], Outcome]) -> Outcome | None:
        """Call the sink, unless stopped."""
        if self._stopped:
            return None
        try:
            return what()
        except Exception:  # noqa: BLE001 - sinks do not raise; one that does must not end this
            self.counts["sink-errors"] += 1
            _log.exception("the sink raised")
            return None


def _number(target: Target, at_ns: int) -> tuple[str, int]:
    """Without the name of the run a number says nothing."""
    return target.incarnation, at_ns if target.incarnation else 0
