"""The sending half for tools and tests: a node for each entity, with its hint as parameters."""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Iterable, Iterator

import attrs

from beacon_core.checks import period_ns
from beacon_core.errors import UsageError
from beacon_core.hint import BeaconHint
from beacon_core.ports.health import Condition, Health
from beacon_core.validator import require_id
from beacon_ros.participant import NO_FORK, OwnNode
from beacon_ros.spinner import Spinner
from beacon_ros_param.answers import AnsweringNode
from beacon_ros_param.declared import Declared
from beacon_ros_param.options import RosParamOptions

__all__ = ["RosParamAnnouncer"]

_LINGER_S = 0.5
"""How long ``close`` waits for whoever asks to have asked once more: it gets to know that way."""

_CLOSE_WITHIN_S = 0.9
_WITHDRAW_WITHIN_S = 0.9

_MISSED_AFTER_INTERVALS = 3
_MISSED_AFTER_S = 15.0
"""Whoever asked, and has not for so long, is gone. Three intervals by default, or three of ours if
those are longer: the asker's are not known here."""

_numbers: Iterator[int] = itertools.count(1)


@attrs.define(eq=False)
class _Voice:
    """An entity's node, and what it says."""

    node: AnsweringNode
    declared: Declared
    withdrawn_ns: int = 0
    """0: it still speaks."""


class RosParamAnnouncer:
    """Implements :class:`beacon_core.ports.announcer.Announcer`; the thread rule is the port's.

    It is asked, and says nothing by itself: the period has no meaning here, and a hint is heard as
    often as somebody asks. An entity has a node of its own, ``/beacon_param_<pid>_<n>``, that can
    do nothing but be asked. A ROS program that speaks for itself uses
    :func:`beacon_ros_param.beacon.declare_beacon` on the node that it has.
    """

    def __init__(self, options: RosParamOptions, period_s: float | None = None) -> None:
        """Raises ``ConfigError`` for a period that is not above 0, and where ROS refuses."""
        period_ns(period_s)
        missed_s = max(_MISSED_AFTER_S, _MISSED_AFTER_INTERVALS * options.interval_s)
        self._missed_ns = round(missed_s * 1e9)
        self._keep_ns = round(2 * options.interval_s * 1e9)
        self._pid = os.getpid()
        self._lock = threading.Lock()
        self._voices: dict[str, _Voice] = {}
        self._closed = False
        self._own = OwnNode("param_announcer", options.domain_id)
        self.spinner = Spinner(self._own.context, self._own.node)
        """Serves the nodes. While it is busy with something else, nobody gets an answer."""

    def announce(self, hint: BeaconHint) -> None:
        require_id(hint.entity_id, "announce: ")
        if self._pid != os.getpid():
            raise UsageError(f"announce: made before a fork; {NO_FORK}")
        with self._lock:
            if self._closed:
                raise UsageError("announce: this announcer is closed; make a new one")
            self._clear_away()
            voice = self._voices.get(hint.entity_id)
            if voice is None:
                self._voices[hint.entity_id] = self._new_voice(hint)
                return
            voice.withdrawn_ns = 0
            self.spinner.run(lambda: voice.declared.say(hint))

    def withdraw(self, entity_id: str) -> None:
        if self._pid != os.getpid():
            return
        with self._lock:
            voice = self._voices.get(entity_id)
            if self._closed or voice is None or voice.withdrawn_ns:
                return
            self._silence([voice], _WITHDRAW_WITHIN_S)
            self._clear_away()

    def close(self) -> None:
        if self._pid != os.getpid():
            return  # before the lock: the fork may have left it held for ever
        deadline = time.monotonic() + _CLOSE_WITHIN_S
        with self._lock:
            if self._closed:
                return
            self._closed = True
            voices = list(self._voices.values())
            self._silence([one for one in voices if not one.withdrawn_ns], _CLOSE_WITHIN_S / 3)
        _wait_until_asked(voices)
        self.spinner.close(max(0.0, deadline - time.monotonic()))
        # Hundreds of nodes take longer than anybody wants to wait.
        ending = threading.Thread(target=self._destroy, args=(voices,), name="beacon-ros-ending")
        ending.start()
        ending.join(max(0.0, deadline - time.monotonic()))

    def health(self) -> Health:
        voices = [one for one in list(self._voices.values()) if not one.withdrawn_ns]
        counters = {"entities": len(voices)}
        if self._closed:
            return Health(Condition.CLOSED, counters=counters)
        if not self._own.context.ok():
            detail = "the ROS context was shut down; make a new announcer"
            return Health(Condition.DOWN, detail, counters)
        if not voices:
            return Health(Condition.UP, counters=counters)
        asked_ns = max(voice.node.asked_ns for voice in voices)
        if asked_ns and time.monotonic_ns() - asked_ns < self._missed_ns:
            return Health(Condition.UP, counters=counters)
        name = voices[0].node.get_fully_qualified_name()
        detail = (
            f"nobody asks for the parameters of {name}; "
            "is the gateway in the same ROS domain? Ask: beacon doctor"
        )
        return Health(Condition.DOWN if asked_ns else Condition.STARTING, detail, counters)

    def _new_voice(self, hint: BeaconHint) -> _Voice:
        name = f"beacon_param_{self._pid}_{next(_numbers)}"
        node = AnsweringNode(name, self._own.context)
        voice = _Voice(node, Declared(node))
        voice.declared.say(hint)
        self.spinner.add_node(node)
        return voice

    def _silence(self, voices: Iterable[_Voice], within_s: float) -> None:
        def withdraw() -> None:
            for voice in voices:
                voice.withdrawn_ns = time.monotonic_ns()
                voice.declared.withdraw()

        self.spinner.run(withdraw, within_s)

    def _clear_away(self) -> None:
        """Destroy nodes whose withdrawal has been seen by now. Called under the lock."""
        before_ns = time.monotonic_ns() - self._keep_ns
        for entity_id, voice in list(self._voices.items()):
            if 0 < voice.withdrawn_ns < before_ns:
                del self._voices[entity_id]
                self.spinner.remove_node(voice.node)
                voice.node.destroy_node()

    def _destroy(self, voices: Iterable[_Voice]) -> None:
        for voice in voices:
            voice.node.destroy_node()
        self._own.close()


def _wait_until_asked(voices: Iterable[_Voice]) -> None:
    """Whoever asked these before, and is still there, is let ask once more."""
    waiting = [one for one in voices if one.node.asked_ns and _has_askers(one.node)]
    deadline = time.monotonic() + _LINGER_S
    pause = threading.Event()
    while any(one.node.asked_ns < one.withdrawn_ns for one in waiting):
        if time.monotonic() >= deadline:
            return
        pause.wait(0.005)


def _has_askers(node: AnsweringNode) -> bool:
    return node.count_clients(f"{node.get_fully_qualified_name()}/list_parameters") > 0
