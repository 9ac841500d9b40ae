"""Everything at once: store, intake, clock and a bad network, against the rules written naively.

One machine draws announcers that come, speak, say goodbye, crash and come back, sources that are
restarted, links that lose, repeat, delay and reorder, partitions, wrong clocks, clocks that are
set, floods, hostile payloads, time that passes, jumps or stands still just before a deadline.
Whatever reaches the intakes reaches the naive rules too, in the same order and at the same time,
and both must say the same: at each message its verdict, and after each step all that can be seen.

In half of the runs the store is looked at after each step. In the others hardly ever, so that it
has to settle much at once, late.

    BEACON_MACHINE_SEED=7 pytest tests/property/test_machine.py           another run than usual
    BEACON_SOAK_STEPS=2000000 pytest -m slow tests/property/test_machine.py          a long one
"""

from __future__ import annotations

import logging
import os
import time
from collections import Counter
from collections.abc import Iterator
from typing import Any
from unittest.mock import patch

import attrs
import pytest
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from beacon_core import lifecycle
from beacon_core.clock import ManualClock
from beacon_core.outcome import Verdict
from beacon_core.store import HintStore
from beacon_core.wire import json
from beacon_fake import LAN, FakeAnnouncer, FakeNetwork, FakeSource, Kind, Link, Message
from tests.property.drawn import (
    HINTS,
    IDS,
    PAYLOADS,
    Age,
    Setup,
    ages,
    hints,
    ids,
    links,
    names,
    payloads,
    periods,
    plain_words,
    runs,
    setups,
    skews_s,
    speakers,
    stamps,
)
from tests.property.naive_intake import nameless
from tests.property.naive_store import Entity, NaiveStore, Voice, picture
from tests.property.running import first_seed, run
from tests.property.side_by_side import (
    Pair,
    Reader,
    check_accounts,
    check_caps,
    check_changes,
    check_next_deadline,
    check_one,
    check_stats,
    fields,
    met,
    new_pair,
    seen,
    unlike,
)

SECOND = 10**9
MAX_SOURCES = 12
"""Instead of 10,000, so that the table of sources overflows."""
SLACK = 2
"""Instead of 64, so that heaps are rebuilt."""

CI_STEPS = 50_000
STEPS_PER_RUN = 100
RUNS_PER_SEED = 550
"""Some runs end early."""


class Machine(RuleBasedStateMachine):
    setup: Setup

    @initialize(setup=setups)
    def begin(self, setup: Setup) -> None:
        self.setup = setup
        self.clock = ManualClock()
        self.network = FakeNetwork(self.clock, seed=setup.seed, link=LAN)
        with patch("beacon_core.register.MAX_REMOVED", setup.max_removed):
            self.store = HintStore(
                self.clock,
                ttl_s=setup.ttl_s,
                expiry_s=setup.ttl_s * setup.expiry_factor,
                max_hints=setup.max_hints,
                max_bytes=setup.max_bytes,
            )
        self.naive = NaiveStore(
            self.store.ttl_ns,
            self.store.expiry_ns,
            setup.max_hints,
            setup.max_bytes,
            setup.max_removed,
        )
        self.pairs = [
            new_pair(self.store, self.naive, setup, MAX_SOURCES) for _ in range(setup.receivers)
        ]
        self.sources = [FakeSource(self.network, f"g{n}") for n in range(setup.receivers)]
        for source, pair in zip(self.sources, self.pairs, strict=True):
            source.start(pair)
        self.announcers: dict[str, FakeAnnouncer] = {}
        self.faithful, self.lazy = Reader(), Reader()
        self.marks = [(0, 0)]
        self.steps = self.peak = 0

    # -- announcers, the network between, and its other end

    @rule(name=names, hint=hints, period=periods, skew_s=skews_s)
    def announce(self, name: str, hint: str, period: float | None, skew_s: float) -> None:
        if name not in self.announcers:
            self.announcers[name] = FakeAnnouncer(
                self.network,
                name,
                period_s=period and period * self.setup.ttl_s,
                clock_offset_s=skew_s,
            )
        self.announcers[name].announce(HINTS[hint])

    @rule(name=names, how=st.sampled_from(["withdraw", "close", "crash", "vanish"]), entity_id=ids)
    def end(self, name: str, how: str, entity_id: str) -> None:
        if name not in self.announcers:
            return
        if how == "withdraw":
            self.announcers[name].withdraw(entity_id)
            return
        announcer = self.announcers.pop(name)
        if how == "close":
            announcer.close()
        elif how == "crash":
            self.network.crash(name)
        else:
            # As if its machine lost power: nobody notices.
            announcer.vanish()
            self.network.leave(announcer)

    @rule(link=links, sender=st.sampled_from(["*", "r1", "r2"]))
    def change_links(self, link: Link, sender: str) -> None:
        self.network.set_link(link, sender=sender)

    @rule(group=st.sampled_from([["r1"], ["r1", "g0"], ["g1"], []]))
    def partition(self, group: list[str]) -> None:
        self.network.partition(group)

    @rule()
    def restart_source(self) -> None:
        number = self.steps % len(self.sources)
        self.sources[number].close()
        self.sources[number] = FakeSource(self.network, f"g{number}")
        self.sources[number].start(self.pairs[number])

    @rule(name=st.sampled_from(["s1", "r1", "x"]), count=st.integers(1, 15), hint=hints)
    def flood(self, name: str, count: int, hint: str) -> None:
        """Many invented ids from one source; from ``x`` also as many invented sources."""

        def payload(number: int) -> bytes:
            return json.encode(attrs.evolve(HINTS[hint], entity_id=f"{hint}-{number}"))

        if name == "x":
            for number in range(count):
                self.network.send(Message(Kind.HINT, f"x{number}", payload=payload(number)))
        else:
            self.network.flood(name, payload, rate=100.0, duration_s=count / 100)

    @rule(name=speakers, payload=payloads, entity_id=st.sampled_from(["", "a"]))
    def send_anything(self, name: str, payload: str, entity_id: str) -> None:
        self.network.send(Message(Kind.HINT, name, entity_id, PAYLOADS[payload]))

    # -- time

    @rule(parts=st.sampled_from([0.001, 0.1, 0.4, 0.7, 1.0]))
    def go_on(self, parts: float) -> None:
        self.network.advance(int(parts * self.naive.ttl))

    @rule(choice=st.integers(0, 12), stand_still=st.booleans())
    def wait_just_until(self, choice: int, *, stand_still: bool) -> None:
        ttl, expiry = self.naive.ttl, self.naive.expiry
        now = self.clock.monotonic_ns()
        to_deadline = (self.naive.next_deadline() or 0) - now
        to_token = self.pair.naive.next_token(now)
        ns = [
            to_token,
            to_token - 1,
            to_deadline,
            to_deadline - 1,
            to_deadline + 1,
            1,
            ttl,
            ttl - 1,
            ttl + 1,
            expiry,
            expiry - ttl,
            expiry - 1,
            3 * expiry,
        ][choice]
        ns = max(ns, 0)
        if stand_still or ns > 3 * ttl:
            # As of a machine that was asleep: everything arrives late, and at once.
            self.clock.advance(ns)
            self.network.deliver_due()
        else:
            self.network.advance(ns)

    @rule(jump_s=st.sampled_from([-3600, -1, 1, 4, 1e6]))
    def set_wall_clock(self, jump_s: float) -> None:
        self.clock.set_wall(self.clock.wall_ns() + int(jump_s * SECOND))

    # -- straight to an intake, and to the store

    @property
    def pair(self) -> Pair:
        """Each of them in turn."""
        return self.pairs[self.steps % len(self.pairs)]

    @rule(hint=hints, name=speakers, stamp=stamps, run=runs)
    def offer(self, hint: str, name: str, stamp: tuple[str, Age], run: tuple[str, int]) -> None:
        where, age = stamp
        stamp_ns = max(0, self.clock.wall_ns() - self._ns(age))
        self.pair.offer(
            json.encode(HINTS[hint], stamp_ns if where == "inside" else 0),
            name,
            stamp_ns=stamp_ns if where == "beside" else 0,
            incarnation=run[0],
            sequence=run[1],
        )

    @rule(said=plain_words)
    def chatter(self, said: list[tuple[str, str]]) -> None:
        """What a carrier brings that knows no more than a payload and whose it is."""
        pair = self.pair
        for hint, name in said:
            pair.offer(PAYLOADS[hint], name)

    @rule(index=st.integers(0, 20))
    def offer_again(self, index: int) -> None:
        """As a carrier that repeats."""
        self._repeat(index, {})

    @rule(
        index=st.integers(0, 6),
        number=st.integers(0, 9),
        name=st.sampled_from([None, None, "r1", "s1", "s2"]),
        about=st.sampled_from(["", "", "a", "b"]),
        fresh=st.booleans(),
    )
    def offer_the_like(
        self, index: int, number: int, name: str | None, about: str, *, fresh: bool
    ) -> None:
        """What the same announcer might say next, or before, or somebody else might repeat."""
        change: dict[str, Any] = {"sequence": number, "entity_id": about}
        if fresh:
            change["stamp_ns"] = self.clock.wall_ns()
        self._repeat(index, change, name)

    def _repeat(self, index: int, change: dict[str, Any], name: str | None = None) -> None:
        pair = self.pair
        if pair.offers:
            payload, source, envelope = pair.offers[-1 - index % len(pair.offers)]
            pair.offer(payload, name or source, **{**envelope, **change})

    def _ns(self, age: Age) -> int:
        return int(age[0] * self.naive.ttl) + int(age[1] * self.naive.expiry) + age[2]

    @rule(entity_id=ids, name=speakers, run=runs, crashed=st.booleans())
    def depart(self, entity_id: str, name: str, run: tuple[str, int], *, crashed: bool) -> None:
        if self.steps % 3 == 0:
            self._depart_straight(entity_id, name, run, crashed=crashed)
        elif crashed:
            self.pair.lost(entity_id, name, incarnation=run[0])
        else:
            self.pair.goodbye(entity_id, name, incarnation=run[0], sequence=run[1])

    def _depart_straight(
        self, entity_id: str, name: str, run: tuple[str, int], *, crashed: bool
    ) -> None:
        now, (incarnation, number) = self.clock.monotonic_ns(), run
        who = {"source": name, "incarnation": incarnation}
        if crashed:
            verdict = self.store.lost(entity_id, **who, reason="cut")
            speaker = nameless(entity_id, name, incarnation, 0, now)
            wanted = self.naive.depart("lost", speaker, now, "cut")
        else:
            verdict = self.store.goodbye(entity_id, **who, sequence=number)
            speaker = nameless(entity_id, name, incarnation, number, now)
            wanted = self.naive.depart("goodbye", speaker, now)
        assert verdict == wanted

    @rule(number=st.integers(0, 9), crashed=st.booleans())
    def depart_as_the_holder(self, number: int, *, crashed: bool) -> None:
        """Somebody who is there, under its own name."""
        found = self._most(["active", "stale", "left"] if number % 2 else ["stale", "active"])
        if found:
            run = found[1].holder.incarnation, number
            self.depart(found[0], found[1].holder.source, run, crashed=crashed)

    def _most(self, wanted: list[str]) -> tuple[str, Entity] | None:
        """Somebody whose status is as early in the list as can be found."""
        entities = self.naive.entities.items()
        found = [one for one in entities if one[0] in IDS and one[1].status in wanted]
        return min(found, key=lambda one: (wanted.index(one[1].status), one[0]), default=None)

    @rule(number=st.integers(0, 9), after=st.integers(0, 1), name=speakers)
    def leave_and_be_followed_late(self, number: int, after: int, name: str) -> None:
        """One that was silent says goodbye, and a message of another, as old, comes after it."""
        found = self._most(["stale"])
        if found:
            entity_id, holder = found[0], found[1].holder
            self.depart(entity_id, holder.source, (holder.incarnation, 0), crashed=False)
            self._update(f"{entity_id}{number}", holder.heard + after, name, ("i3", 1))

    @rule(
        number=st.integers(0, 9),
        further=st.sampled_from([None, -1, 0, 1, 1]),
        after=st.sampled_from([None, None, -1, 0, 1]),
    )
    def a_predecessor_speaks(self, number: int, further: int | None, after: int | None) -> None:
        """Who spoke under an id before, perhaps late, while its successor may have gone."""
        found = self._succeeded()
        if found is None:
            return
        entity_id, entity = found
        others = [(one.source, one.incarnation, one.number) for one in entity.others]
        others += [("s2", run, last) for run, last in entity.former_runs.items()]
        name, run, last = others[number % len(others)]
        count = 0 if further is None else max(0, last + further)
        sent = None if after is None else entity.holder.heard + after
        self._update(f"{entity_id}{number}", sent, name, (run, count))

    @rule(
        entity_id=ids,
        times=st.integers(2, 6),
        pause=st.sampled_from([0, 1, SECOND // 20]),
        crashed=st.sampled_from([None, True, False]),
    )
    def restart_again_and_again(
        self, entity_id: str, times: int, pause: int, *, crashed: bool | None
    ) -> None:
        """More runs than are remembered, of which the last one may go."""
        for number in range(times):
            self._update(f"{entity_id}0", None, "s1", (f"n{number}", number + 1))
            self.clock.advance(pause)
        if crashed is not None:
            self.depart(entity_id, "s1", (f"n{times - 1}", 0), crashed=crashed)

    def _succeeded(self) -> tuple[str, Entity] | None:
        """An entity under whose id somebody spoke before, rather one whose holder has gone."""
        entities = self.naive.entities.items()
        found = [one for one in entities if one[0] in IDS and (one[1].others or one[1].former_runs)]
        return min(found, key=lambda one: (one[1].status == "active", one[0]), default=None)

    @rule(hint=hints, age=ages, name=speakers, run=runs)
    def update(self, hint: str, age: Age | None, name: str, run: tuple[str, int]) -> None:
        sent = None if age is None else self.clock.monotonic_ns() - self._ns(age)
        self._update(hint, sent, name, run)

    @rule(number=st.integers(0, 9), after=st.integers(-1, 1), name=speakers, run=runs)
    def update_from_about_then(
        self, number: int, after: int, name: str, run: tuple[str, int]
    ) -> None:
        """As if sent when somebody was heard last, or when it left; or a nanosecond beside that."""
        found = self._most(["left", "stale", "active"])
        if found:
            entity_id, entity = found
            of_its_last_step = number % 3 == 0 and entity.history
            sent = entity.history[-1][0] if of_its_last_step else entity.holder.heard
            self._update(f"{entity_id}{number}", sent + after, name, run)

    def _update(self, hint: str, sent: int | None, name: str, run: tuple[str, int]) -> None:
        now, (incarnation, number) = self.clock.monotonic_ns(), run
        verdict = self.store.update(
            HINTS[hint],
            received_at_ns=sent,
            source=name,
            incarnation=incarnation,
            sequence=number,
        )
        sent = now if sent is None else sent
        message = Voice(fields(HINTS[hint]), name, incarnation, number, sent)
        met.update([verdict])
        assert verdict == self.naive.hear(message, now)

    @rule(entity_id=st.sampled_from([*IDS, "nobody", None]))
    def forget(self, entity_id: str | None) -> None:
        wanted = self.naive.forget(entity_id, self.clock.monotonic_ns())
        assert self.store.forget(entity_id) == wanted

    # -- looking

    @rule(entity_id=ids, back=st.integers(0, 30))
    def ask(self, entity_id: str, back: int) -> None:
        """One of the questions; each has to settle what is due by itself."""
        store, naive, now = self.store, self.naive, self.clock.monotonic_ns()
        revision, naive_revision = self.marks[max(0, len(self.marks) - 1 - back)]
        before = naive.revision
        naive.settle(now)
        wanted = naive.entities.get(entity_id)
        question = back % 6
        if question == 0:
            check_changes(store, naive, revision, naive_revision)
        elif question == 1:
            assert (store.sweep() == 0) == (naive.revision == before)
        elif question == 2:
            stored = store.get(entity_id)
            assert (stored and seen(stored)) == (wanted and picture(wanted))
        elif question == 3:
            assert store.last_seen_ns(entity_id) == (wanted and wanted.holder.heard)
        elif question == 4:
            self.lazy.follow(store, naive)
        else:
            nowhere = store.revision + 1000 if back % 2 else -1
            changes = store.changes_since(nowhere)
            assert changes.too_old
            assert [one.entity_id for one in changes.hints] == naive.changed_since(0)

    @rule()
    def look(self) -> None:
        now = self.clock.monotonic_ns()
        self.naive.settle(now)
        everything = self.store.changes_since(0)
        by_id = {one.entity_id: one for one in everything.hints}
        assert len(by_id) == len(everything.hints)
        got = {name: seen(one) for name, one in by_id.items()}
        wanted = {name: picture(entity) for name, entity in self.naive.entities.items()}
        assert unlike(got, wanted) == []
        for name, stored in by_id.items():
            check_one(stored, self.naive.entities[name], self.store, now)
            assert self.store.get(name) == stored
        assert self.store.snapshot() == [one for one in everything.hints if one.status != "left"]
        check_stats(self.store, self.naive, by_id)
        for reader in (self.faithful, self.lazy):
            reader.follow(self.store, self.naive)
            assert unlike(reader.known, got) == []
            assert list(reader.known) == list(by_id)

    # -- after each step

    @precondition(lambda self: hasattr(self, "steps"))
    @invariant()
    def both_agree(self) -> None:
        self.steps += 1
        for pair in self.pairs:
            assert pair.disagreements == []
            check_accounts(pair, MAX_SOURCES)
        check_next_deadline(self.store, self.naive)
        mark = self.store.revision, self.naive.revision
        assert (mark[0] == self.marks[-1][0]) == (mark[1] == self.marks[-1][1])
        if mark != self.marks[-1]:
            assert mark[0] > self.marks[-1][0]
            self.marks.append(mark)
        if self.setup.watched:
            self.look()
        self.peak = max(self.peak, len(self.naive.entities))
        check_caps(self.store, self.pairs, self.peak, SLACK)

    def teardown(self) -> None:
        if hasattr(self, "steps"):
            self.look()
            steps_taken.update([self.steps])
            assert all(source.health().counters["sink-faults"] == 0 for source in self.sources)


# -- how far it is run ---------------------------------------------------------------------------

steps_taken: Counter[int] = Counter()


@pytest.fixture(autouse=True)
def small_world(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A small table of sources, no log, and a note of each step in the lifecycle."""

    def transition(status: lifecycle.Status, cause: lifecycle.Cause) -> lifecycle.Status:
        met.update([(status, cause)])
        return lifecycle.transition(status, cause)

    monkeypatch.setattr("beacon_core.store.transition", transition)
    monkeypatch.setattr("beacon_core.register.transition", transition)
    monkeypatch.setattr("beacon_core.sources.MAX_SOURCES", MAX_SOURCES)
    monkeypatch.setattr("beacon_core.deadlines._SLACK", SLACK)
    monkeypatch.setattr("beacon_core.room._SLACK", SLACK)
    met.clear()
    steps_taken.clear()
    logging.disable(logging.CRITICAL)
    yield
    logging.disable(logging.NOTSET)


def steps() -> int:
    return sum(count * times for count, times in steps_taken.items())


# Only a failing run takes that long: it is made as small as it can be.
@pytest.mark.timeout(900)
def test_whatever_happens_the_core_does_what_the_naive_rules_say() -> None:
    try:
        run(Machine, runs=RUNS_PER_SEED, steps_per_run=STEPS_PER_RUN)
    finally:
        print(f"{steps()} steps")  # noqa: T201
    assert steps() >= CI_STEPS
    never_met = {*Verdict, *lifecycle.TRANSITIONS} - set(met)
    assert never_met == set()


@pytest.mark.slow
@pytest.mark.timeout(0)
def test_so_it_does_for_as_long_as_one_cares_to_watch(capsys: pytest.CaptureFixture[str]) -> None:
    wanted = int(os.environ.get("BEACON_SOAK_STEPS", "200000"))
    began, seed = time.monotonic(), first_seed()
    while steps() < wanted:
        # A seed at a time, since what was tried before is remembered for as long as one lasts.
        run(Machine, runs=RUNS_PER_SEED, steps_per_run=STEPS_PER_RUN, seed=seed)
        with capsys.disabled():
            took = time.monotonic() - began
            print(f"seed {seed} passed; {steps()} steps in {took:.0f} s", flush=True)  # noqa: T201
        seed += 1
