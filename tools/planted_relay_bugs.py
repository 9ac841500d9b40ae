"""What planted_bugs.py plants into the relay: each bug with what is right and what is wrong."""

from __future__ import annotations

__all__ = ["RELAY_BUGS"]

RELAY_BUGS = [
    (
        "track: what has been passed on is taken again",
        "if seq < self.cursor or seq in self._held or seq >= self.next:",
        "if seq in self._held or seq >= self.next:",
    ),
    (
        "peer: all that an older forwarder has is wanted",
        "if answer.age_ns > said_hello_after_ns:",
        "if False:",
    ),
    ("peer: who comes late gets volatile messages of before", "return met.next", "return met.low"),
    (
        "peer: one with topics may give way",
        "return not (self.lanes or self.tracks or self.wanted or self.pending)",
        "return not self.pending",
    ),
    (
        "publishers: a publisher stays though the type has changed",
        "if lane.offers != (head.advertised.type, head.advertised.qos):",
        "if lane.offers is None:",
    ),
    (
        "asking: nobody asks for what is missing",
        'self._alarms.set_if_none(("ask", origin, route), now_ns + self._settings.ask_after_ns)',
        "pass",
    ),
    (
        "asking: who waits for a gap counts from the last message, not from the gap",
        "elif gap not in self._stalls or self._stalls[gap][0] != track.cursor:",
        "else:",
    ),
    (
        "republisher: digests that disagree are believed",
        "elif not peer.agrees(digest):",
        "elif False:",
    ),
    (
        "republisher: an older route of a topic may follow a newer one",
        "if one.route < peer.passed.get(one.name, 0):",
        "if False:",
    ),
    (
        "republisher: what was missing of a former life is waited for",
        "track.end(Fate.RESTARTED)",
        "pass",
    ),
    (
        "republisher: what is held is not counted",
        "        self._held_bytes += track.held_bytes - before\n        if placed",
        "        if placed",
    ),
    (
        "republisher: an answer of an older life is believed",
        "if answer.epoch > peer.epoch:",
        "if answer.epoch != peer.epoch:",
    ),
    (
        "forgetting: nothing is remembered of who gave way",
        "self._of[peer.origin] = Memory(now_ns + 1, peer.epoch, max(peer.known, default=0))",
        "self._of[peer.origin] = self._anybody",
    ),
    (
        "flow: how far the forwarder has come is not noted",
        "if known.next < after:",
        "if known.next > after:",
    ),
    (
        "lane: routes follow each other as they come",
        "bisect.insort(self.tracks, track, key=_turn)",
        "self.tracks.append(track)",
    ),
    (
        "forwarder: a topic that changes its type stays the same route",
        "if self._seen.get(topic) != seen:",
        "if topic not in self._seen:",
    ),
    (
        "forwarder: who asks for what is gone is not told so",
        "if one.start < route.history.low and self._may_tell(route):",
        "if False:",
    ),
    (
        "forwarder: it holds twice as much as it may",
        "while self._held_bytes > self._settings.hold_bytes:",
        "while self._held_bytes > 2 * self._settings.hold_bytes:",
    ),
    (
        "forwarder: its own message, come back, goes round again",
        "        if first == self._origin:\n            return Fate.ECHO\n",
        "",
    ),
    (
        "forwarder: the second of two that say hello at once is never answered",
        "        if self._hellos:\n            self._alarms.set(",
        "        if not self._hellos:\n            self._alarms.set(",
    ),
    (
        "forwarder: best effort is kept after it was sent",
        "            if route.mode is Mode.BEST_EFFORT:\n                # It was kept",
        "            if False:\n                # It was kept",
    ),
    (
        "history: what was sent ends in no book",
        "        self._ledger.settle(unsent if kept.sent_ns is None else Fate.SENT)\n",
        "        if kept.sent_ns is None:\n            self._ledger.settle(unsent)\n",
    ),
    (
        "waiting: what waits is announced",
        "self.history.next if self.new is None else max(self.new, self.history.low)",
        "self.history.next",
    ),
    (
        "waiting: a message of exactly its age goes out",
        "self._taken[0] + self._max_age_ns <= now_ns",
        "self._taken[0] + self._max_age_ns < now_ns",
    ),
    (
        "outlet: contents are not paid for",
        "        self.pay(size, now_ns)\n",
        "",
    ),
    (
        "outlet: who has waited is forgotten when its turn comes",
        "        self._later.pop(one.number, None)\n        self._waits.add(one.number)\n",
        "        self._later.pop(one.number, None)\n",
    ),
    (
        "outlet: lower classes never go while a higher one waits",
        "self._passed_over >= PATIENCE - 1",
        "False",
    ),
    (
        "outlet: a lower class goes too often",
        "self._passed_over >= PATIENCE - 1",
        "self._passed_over >= PATIENCE - 2",
    ),
    (
        "outlet: the lowest class goes first",
        "for one in reversed(range(PRIORITIES)) if",
        "for one in range(PRIORITIES) if",
    ),
    (
        "outlet: of the lower classes it is always the same one's turn",
        "min(waiting[1:], key=self._turns.__getitem__)",
        "waiting[-1]",
    ),
    (
        "pace: what is spent is paid for by the past",
        "self._paid_ns = max(self._paid_ns, now_ns) + math.ceil(",
        "self._paid_ns = self._paid_ns + math.ceil(",
    ),
    (
        "route: a closed route does not tell of what waits",
        "return self.history.next if self.closed else self.waiting.told_next()",
        "return self.waiting.told_next()",
    ),
    (
        "names: no loop is ever found",
        "                found = _walk(links, (start, number), _parts(rule.pattern))\n",
        "                found = None\n",
    ),
    (
        "alarms: a new time is not told",
        "        self.changed = True\n        self._serial += 1\n",
        "        self._serial += 1\n",
    ),
]
