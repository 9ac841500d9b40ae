"""What the contract suite needs of a carrier: a :class:`Harness`, written once per adapter.

The suite looks at an adapter through a :class:`Listener`: a gateway in miniature, in which a
:class:`Tap` between the source and the intake writes down what was called, from where and when.

Nothing here imports pytest, so a harness may also be used outside the suite.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Protocol

import attrs

from beacon_core.clock import Clock, SystemClock
from beacon_core.hint import BeaconHint
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.outcome import Outcome, Verdict
from beacon_core.ports.adapter import Adapter
from beacon_core.ports.announcer import Announcer
from beacon_core.ports.sink import HintSink
from beacon_core.ports.source import HintSource
from beacon_core.store import HintStore
from beacon_core.testing.hostile import HOSTILE_JSON
from beacon_core.testing.waiting import wait_until

__all__ = [
    "CLOSE_WITHIN_S",
    "Call",
    "Capabilities",
    "Harness",
    "Listener",
    "RealTimeHarness",
    "Tap",
    "within",
]

CLOSE_WITHIN_S = 1.0
"""What the ports promise of ``close``."""


@attrs.frozen
class Capabilities:
    """What a carrier can do. Each ``True`` is a promise that the suite tests.

    A carrier that cannot do something says ``False``: the checks of that promise are then shown
    as skipped, with the name of the capability, instead of passing silently.
    """

    orders: bool = True
    """Messages of one announcer arrive in the order sent."""
    lossless: bool = True
    """Nothing is lost while both ends are up and the load is moderate (some 1,000 messages): the
    last word about each entity arrives."""
    every_word: bool = True
    """Each word does, also of several in quick succession about one entity. Not so where a source
    asks now and then."""
    pushes: bool = True
    """An announcer decides when it is heard: when told, and each period. Where sources ask instead
    it is heard as often as it is asked, and :meth:`Harness.silenced` makes it fall silent."""
    late_joiner_sees_present: bool = True
    """A source that starts late is told the present hints without waiting for the next period."""
    has_goodbye: bool = True
    """``withdraw`` and ``close`` of an announcer reach the source as a goodbye."""
    detects_crash: bool = True
    """An announcer that vanishes without a goodbye is reported as lost."""
    tells_senders_apart: bool = True
    """Two announcers arrive under two ``source`` names."""
    knows_incarnations: bool = True
    """The carrier brings the announcer's incarnation and sequence beside the payload."""
    vouches_for_ids: bool = True
    """A message says, apart from its payload, whom it may speak for (a key, a node name)."""
    raw_payloads: bool = True
    """Hints travel as bytes, so that anybody can send anything: ``send_raw`` works."""
    empty_payloads: bool = True
    """A payload of no bytes at all arrives as such."""
    nul_in_text: bool = True
    """A text may hold a NUL character. Carriers of C strings end at it."""


class Harness(Protocol):
    """One carrier with everything on it, made anew for each check.

    ``network`` numbers carriers that must not hear each other: two brokers, two domains, two key
    prefixes. Thread rule: the suite calls from one thread at a time, ``wait_until`` included,
    except that announcers are used from several threads as their port allows.
    """

    @property
    def adapter(self) -> Adapter: ...

    @property
    def capabilities(self) -> Capabilities: ...

    @property
    def clock(self) -> Clock:
        """The clock that stores are made with; the one that ``wait_until`` waits by."""

    @property
    def patience_s(self) -> float:
        """How long to wait for what must come. Only a failing check waits that long."""

    @property
    def quiet_s(self) -> float:
        """How long to listen before believing that nothing comes."""

    @property
    def ttl_s(self) -> float:
        """A short time to live, for the checks in which time must pass."""

    @property
    def bad_options(self) -> Sequence[Mapping[str, Any]]:
        """Keyword arguments which ``adapter.options`` must refuse with ``ConfigError``."""

    @property
    def hostile_payloads(self) -> Mapping[str, bytes]:
        """The worst that this wire format allows, each about the entity ``hostile``."""

    def options(self, network: int = 0) -> Any:
        """An instance of ``adapter.options`` that works here."""

    def source(self, network: int = 0) -> HintSource:
        """A new source, not started."""

    def announcer(
        self, period_s: float | None = None, network: int = 0, *, mortal: bool = False
    ) -> Announcer:
        """A new announcer, a sender of its own; ``mortal`` if ``crash`` will be called on it, so
        that a real harness can give it a process of its own."""

    def crash(self, announcer: Announcer) -> None:
        """Let it vanish as if by ``kill -9``: without a goodbye."""

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:
        """Within: nothing is heard of this announcer, which has no period, unless it is told
        anything; it does not say goodbye and may be crashed. Where announcers push there is nothing
        to do; where sources ask, it does not answer."""

    def encode(self, hint: BeaconHint, stamp_ns: int = 0) -> bytes:
        """The payload of a hint as an announcer of this adapter would send it."""

    def send_raw(self, entity_id: str, payload: bytes, *, sender: str = "stranger") -> None:
        """Send any bytes where hints about ``entity_id`` belong, with no incarnation, sequence or
        stamp beside them. Different ``sender`` names are different senders."""

    def wait_until(self, predicate: Callable[[], bool], deadline_s: float) -> bool:
        """Let time pass until ``predicate()`` holds (``True``) or the deadline passed (``False``).

        Must look at once, and often enough not to miss a state that lasts a quarter of ``ttl_s``.
        """

    def close(self) -> None:
        """Close everything that was made here."""


class RealTimeHarness:
    """The half of a :class:`Harness` that is the same for every real carrier.

    A subclass sets ``adapter`` and gives ``options``, ``crash``, ``encode`` and ``send_raw``; where
    sources ask, ``silenced`` too.
    """

    adapter: Adapter
    capabilities: Capabilities = Capabilities()
    clock: Clock = SystemClock()
    patience_s: float = 30.0  # a busy machine may take long to start a process
    quiet_s: float = 0.3
    ttl_s: float = 0.4
    bad_options: Sequence[Mapping[str, Any]] = ()
    hostile_payloads: Mapping[str, bytes] = HOSTILE_JSON
    """Replace them if the wire format is not beacon JSON."""

    def __init__(self) -> None:
        self._made: list[HintSource | Announcer] = []

    def options(self, network: int = 0) -> Any:
        raise NotImplementedError

    def source(self, network: int = 0) -> HintSource:
        source = self.adapter.source(self.options(network))
        self._made.append(source)
        return source

    def announcer(
        self,
        period_s: float | None = None,
        network: int = 0,
        *,
        mortal: bool = False,  # noqa: ARG002 - for subclasses that need a process to kill
    ) -> Announcer:
        announcer = self.adapter.announcer(self.options(network), period_s)
        self._made.append(announcer)
        return announcer

    def silenced(self, announcer: Announcer) -> AbstractContextManager[object]:  # noqa: ARG002 - as above
        return nullcontext()

    def wait_until(self, predicate: Callable[[], bool], deadline_s: float) -> bool:
        return wait_until(predicate, deadline_s)

    def close(self) -> None:
        for thing in reversed(self._made):
            thing.close()
        self._made.clear()


@attrs.frozen
class Call:
    """One call of the sink by a source."""

    kind: str
    """``offer``, ``goodbye`` or ``lost``."""
    payload: bytes
    """Of an offer; otherwise empty."""
    source: str
    outcome: Outcome
    incarnation: str = ""
    sequence: int = 0
    stamp_ns: int = 0
    entity_id: str = ""
    """Whom an offer may speak for, if the carrier said so."""

    @property
    def verdict(self) -> Verdict:
        return self.outcome.verdict


class Tap:
    """A sink that writes down each call and passes it on.

    ``hook``, if set, is run inside each call, before it is passed on; what it raises goes to the
    source. Thread rule: as the sink's.
    """

    def __init__(self, sink: HintSink) -> None:
        self.hook: Callable[[], object] | None = None
        self.failures: list[Exception] = []
        """What the sink behind raised, which it must not."""
        self._sink = sink
        self._calls: list[Call] = []
        self._lock = threading.Lock()

    @property
    def calls(self) -> list[Call]:
        """The finished calls so far, a copy."""
        with self._lock:
            return list(self._calls)

    def offer(
        self,
        payload: bytes,
        source: str,
        *,
        entity_id: str = "",
        stamp_ns: int = 0,
        incarnation: str = "",
        sequence: int = 0,
    ) -> Outcome:
        envelope: dict[str, Any] = {
            "entity_id": entity_id,
            "stamp_ns": stamp_ns,
            "incarnation": incarnation,
            "sequence": sequence,
        }
        with self._passing():
            outcome = self._sink.offer(payload, source, **envelope)
        return self._note(Call("offer", payload, source, outcome=outcome, **envelope))

    def goodbye(
        self, entity_id: str, source: str, *, incarnation: str = "", sequence: int = 0
    ) -> Outcome:
        envelope: dict[str, Any] = {"incarnation": incarnation, "sequence": sequence}
        with self._passing():
            outcome = self._sink.goodbye(entity_id, source, **envelope)
        return self._note(Call("goodbye", b"", source, outcome=outcome, **envelope))

    def lost(
        self, entity_id: str, source: str, *, incarnation: str = "", reason: str = "connection lost"
    ) -> Outcome:
        with self._passing():
            outcome = self._sink.lost(entity_id, source, incarnation=incarnation, reason=reason)
        return self._note(Call("lost", b"", source, outcome=outcome, incarnation=incarnation))

    def repeat(self, call: Call) -> Outcome:
        """Hand in a recorded offer once more, as a carrier that repeats or delays would."""
        return self.offer(
            call.payload,
            call.source,
            entity_id=call.entity_id,
            stamp_ns=call.stamp_ns,
            incarnation=call.incarnation,
            sequence=call.sequence,
        )

    @contextmanager
    def _passing(self) -> Iterator[None]:
        if self.hook is not None:
            self.hook()
        try:
            yield
        except Exception as failure:
            self.failures.append(failure)
            raise

    def _note(self, call: Call) -> Outcome:
        with self._lock:
            self._calls.append(call)
        return call.outcome


class Listener:
    """A gateway in miniature: source -> tap -> intake -> store.

    The rates are high unless given, so that only the checks about rates meet them; the time to
    live is long unless given, so that a slow machine cannot make a hint stale.
    """

    def __init__(
        self,
        harness: Harness,
        *,
        network: int = 0,
        ttl_s: float = 600.0,
        expiry_s: float = 6000.0,
        source_rate: float = 1e6,
        global_rate: float = 1e6,
    ) -> None:
        self._harness = harness
        self._network = network
        self.store = HintStore(harness.clock, ttl_s=ttl_s, expiry_s=expiry_s)
        self.intake = Intake(
            self.store, harness.adapter.decode, source_rate=source_rate, global_rate=global_rate
        )
        self.tap = Tap(self.intake)
        self.source = harness.source(network)

    def start(self) -> Listener:
        self.source.start(self.tap)
        return self

    def restart(self) -> None:
        """Close the source and start a new one on the same store."""
        self.source.close()
        self.source = self._harness.source(self._network)
        self.source.start(self.tap)

    def status(self, entity_id: str) -> Status | None:
        """``None`` when the store has nothing under this id."""
        stored = self.store.get(entity_id)
        return None if stored is None else stored.status

    def has(self, entity_id: str, status: Status = Status.ACTIVE) -> bool:
        return self.status(entity_id) is status

    def says(self, entity_id: str, display_name: str) -> bool:
        """It is known, by that name."""
        stored = self.store.get(entity_id)
        return stored is not None and stored.hint.display_name == display_name

    def count(self, *verdicts: Verdict) -> int:
        """How many messages ended in one of these verdicts."""
        totals = self.intake.totals()
        return sum(totals.get(verdict, 0) for verdict in verdicts)


def within(seconds: float, action: Callable[[], object]) -> None:
    """Run ``action`` in a thread of its own and insist that it ends in time.

    Raises ``AssertionError`` if it does not, and whatever ``action`` raised. The thread of a hung
    action is left behind as a daemon.
    """
    failures: list[BaseException] = []

    def run() -> None:
        try:
            action()
        except BaseException as failure:  # noqa: BLE001 - it is raised again below
            failures.append(failure)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    if not wait_until(lambda: not thread.is_alive(), seconds, pause_s=0.001):
        raise AssertionError(f"did not end within {seconds} s")
    if failures:
        raise failures[0]
