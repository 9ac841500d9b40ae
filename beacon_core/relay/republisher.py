"""The side that publishes what another network's forwarders send: a state machine without I/O.

Theory. Nothing that is sent once is relied on. A forwarder's digest says what there is; whatever is
missing is asked for by resets, each time after twice as long, until it comes, nobody has it any
more or it has been waited for long enough::

    who is this?        hello        -> full digest     see peer.py
    what is this route? reset wanted -> advertisement   see Peer.wanted
    where is number n?  reset ranges -> content         see track.py
    may it go out?      nobody is asked, the topic side says: see lane.py

A content whose route is not known yet waits, capped in bytes. The cap holds for all that waits; a
content that there is no room for is not taken, stays missing, and is asked for when there is room.
Asking goes window by window, so that a backlog comes as fast as it can be taken, and not faster.
Nothing is asked and nothing is given up while there is no link.

A frame of a forwarder's life is believed once that life has answered a hello, and never after a
later life has: so what wanders about of old lives, or is made up, changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

import attrs

from beacon_core.relay.asking import HELLO, Asking
from beacon_core.relay.effects import Effect
from beacon_core.relay.flow import Flow
from beacon_core.relay.forgetting import Forgotten
from beacon_core.relay.frames import Advertisement, Content, Digest, Malformed, Reset, decode
from beacon_core.relay.lane import Cause, Lane, LaneState
from beacon_core.relay.ledger import Fate, Ledger
from beacon_core.relay.machine import Machine
from beacon_core.relay.peer import Peer
from beacon_core.relay.publishers import Publishers
from beacon_core.relay.republishing import (
    FrameCounts,
    LaneStatus,
    RepublisherStats,
    stats_of,
    status_of,
)
from beacon_core.relay.settings import DEFAULT_REPUBLISHING, Republishing
from beacon_core.relay.track import Placed, Track, content_bytes

__all__ = ["Republisher"]

_Key = tuple[str, int, int]


class Republisher(Machine[_Key]):
    """The theory is above. Each method gives what is to be done now.

    Times are nanoseconds of a monotonic clock; one that goes back counts as no time. Thread rule:
    none of its own; the owner holds a lock, or calls from one thread.
    """

    def __init__(
        self,
        *,
        asker: int,
        now_ns: int,
        own: Iterable[int] = (),
        settings: Republishing = DEFAULT_REPUBLISHING,
    ) -> None:
        """``asker``: 64 bits above 0 for this life of it, another one at each start.

        ``own`` are the origins of the forwarders that listen to the network we publish to: what one
        of them took first has come back, and is not published.
        """
        super().__init__(now_ns)
        self._asker, self._own, self._settings = asker, frozenset(own), settings
        self._forgotten = Forgotten(settings, now_ns)
        self._peers: dict[int, Peer] = {}
        self._lanes: dict[int, Lane] = {}
        self._last_lane = 0
        self._flow = Flow(self._own)
        self._held_bytes = 0
        self._past = Ledger()
        self._frames = FrameCounts()
        self._asking = Asking(asker, settings, self._alarms, self._effects, now_ns)
        self._publishers = Publishers(settings, self._alarms, self._effects)

    # -- from the conduit

    def frame(self, header: bytes, payload: bytes, now_ns: int) -> list[Effect]:
        """Something has come in. Never raises for what it is."""
        if now_ns > self._now_ns:  # noqa: PLR1730 - max is a call
            self._now_ns = now_ns
        flown = self._flow.through(header, payload)
        if flown is not None:
            return flown
        frame = decode(header, payload)
        if isinstance(frame, Malformed):
            self._frames.malformed += 1
        elif isinstance(frame, Reset):
            self._frames.foreign += 1
        elif frame.origin in self._own:
            self._frames.own += 1
        else:
            self._heard(frame)
        return self._done()

    def link_up(self, now_ns: int) -> list[Effect]:
        """Frames may get through from now on."""
        self._at(now_ns)
        self._asking.linked = True
        self._asking.need_hello(self._now_ns)
        for peer in self._peers.values():
            peer.heard_ns = self._now_ns
            self._ask_wanted(peer)
            for lane in list(peer.lanes.values()):
                self._run(lane)
        return self._done()

    def link_down(self, now_ns: int) -> list[Effect]:
        """They do not any more: nothing is asked, or given up, until the next :meth:`link_up`."""
        self._at(now_ns)
        self._asking.linked = False
        self._alarms.cancel(HELLO)
        for peer in self._peers.values():
            self._alarms.cancel(("want", peer.origin, 0))
            for route in peer.tracks:
                self._asking.rest(peer.origin, route)
        return self._done()

    # -- from the topic side

    def matched(self, handle: int, matched: int, expected: int, now_ns: int) -> list[Effect]:
        """A publisher has so many subscriptions, and the network shows so many that it could have.

        Ignored of a publisher that is gone, and if a fixed delay is set instead.
        """
        self._at(now_ns)
        lane = self._publishers.lane_of(handle)
        by_delay = self._settings.advertise_delay_ns is not None
        if lane is not None and lane.state is LaneState.WAIT_MATCH and not by_delay:
            lane.reason = f"{matched} of {expected} subscriptions have matched"
            if matched >= expected:
                self._go_live(lane, Cause.MATCHED)
        return self._done()

    def publisher_failed(self, handle: int, reason: str, now_ns: int) -> list[Effect]:
        """It could not be made, or does not work any more. Its handle is gone."""
        self._at(now_ns)
        lane = self._publishers.lane_of(handle)
        if lane is not None:
            self._publishers.fail(lane, reason, self._now_ns)
            self._run(lane)
        return self._done()

    # -- time

    def tick(self, now_ns: int) -> list[Effect]:
        """Do what is due; to be called when :class:`.effects.Arm` says."""
        self._at(now_ns)
        while (due := self._alarms.pop_due(self._now_ns)) is not None:
            self._rung(*due)
        return self._done()

    # -- what people are told

    def lanes(self) -> list[LaneStatus]:
        """Each topic that is published, or waits to be."""
        return [status_of(lane) for lane in self._lanes.values()]

    def stats(self) -> RepublisherStats:
        """The numbers of this moment."""
        pending = sum(len(some) for p in self._peers.values() for some in p.pending.values())
        return stats_of(
            self._past,
            self._lanes.values(),
            held_bytes=self._held_bytes,
            pending=pending,
            origins=len(self._peers),
            routes=sum(len(peer.known) for peer in self._peers.values()),
            frames=attrs.evolve(self._frames),
        )

    # -- joining

    def _heard(self, frame: Advertisement | Content | Digest) -> None:
        if isinstance(frame, Digest) and frame.asker == self._asker:
            self._join_if_new(frame)
        peer = self._peers.get(frame.origin)
        if peer is not None:
            peer.heard_ns = self._now_ns
        if peer is None or frame.epoch > peer.epoch:
            self._frames.unjoined += 1
            self._asking.need_hello(self._now_ns)
        elif frame.epoch < peer.epoch:
            self._frames.stale += 1
        elif isinstance(frame, Content):
            self._content(peer, frame)
        elif isinstance(frame, Digest):
            self._digest(peer, frame)
        else:
            self._advertisement(peer, frame)

    def _join_if_new(self, answer: Digest) -> None:
        said_ns = self._asking.greeting.said_ns(answer.hello)
        if said_ns is None:
            return
        peer = self._peers.get(answer.origin)
        known = self._forgotten.recall(answer.origin, answer.epoch, followed=peer is not None)
        if peer is None:
            if said_ns < known.since_ns or answer.epoch < known.epoch:
                return
            linked = self._asking.linked
            if not self._forgotten.make_room(self._peers, self._now_ns, linked=linked):
                self._frames.crowded += 1
                return
            peer = self._peers[answer.origin] = Peer(answer.origin)
        if answer.epoch > peer.epoch:
            self._leave_life(peer)
            peer.join(answer, said_ns - known.since_ns, known.routes)
            self._forgotten.follow(answer.origin)
            for lane in list(peer.lanes.values()):
                self._run(lane)

    def _leave_life(self, peer: Peer) -> None:
        for route, (_, track) in peer.tracks.items():
            self._flow.remove(peer.origin, route)
            track.end(Fate.RESTARTED)
            self._asking.rest(peer.origin, route)
            self._alarms.cancel(("elder", peer.origin, route))
        for route in list(peer.pending):
            self._drop_pending(peer, route)
        self._alarms.cancel(("want", peer.origin, 0))

    # -- control frames

    def _digest(self, peer: Peer, digest: Digest) -> None:
        if digest.control <= peer.digest_control:
            self._frames.stale += 1
            return
        peer.digest_control = digest.control
        for one in digest.entries:
            if self._has_room_for(peer, one.route):
                known = peer.learn(one.route, one.revision, one.next, digest.control)
                self._follow(peer, one.route, one.low, one.next)
                peer.want_if_unlike(one.route, known.revision)
        if digest.full:
            for route in peer.forget_unnamed(digest):
                self._withdraw(peer, route)
            self._asking.greeted()
        elif not peer.agrees(digest):
            self._asking.need_hello(self._now_ns)
        self._asking.ask_new(peer, self._now_ns)

    def _advertisement(self, peer: Peer, one: Advertisement) -> None:
        known = peer.known.get(one.route)
        overtaken = one.control < peer.full_control if known is None else False
        if overtaken or (known is not None and one.revision < known.revision):
            self._frames.stale += 1
            return
        if not self._has_room_for(peer, one.route):
            return
        known = peer.learn(one.route, one.revision, one.next, one.control)
        if not known.done and one.route not in peer.tracks:
            self._begin_track(peer, one)
        if one.route in peer.tracks:
            peer.tracks[one.route][1].advertised = one
            self._follow(peer, one.route, one.low, one.next)
        self._not_wanted(peer, one.route)

    def _has_room_for(self, peer: Peer, route: int) -> bool:
        if route in peer.known or len(peer.known) < self._settings.max_routes:
            return True
        self._frames.crowded += 1
        return False

    def _follow(self, peer: Peer, route: int, low: int, after: int) -> None:
        found = peer.tracks.get(route)
        if found is not None:
            found[1].announce(low, after)
            self._run(found[0])

    def _withdraw(self, peer: Peer, route: int) -> None:
        self._not_wanted(peer, route)
        found = peer.tracks.get(route)
        if found is not None:
            found[1].end(Fate.WITHDRAWN)
            self._run(found[0])

    # -- advertisements that are missing

    def _ask_wanted(self, peer: Peer) -> None:
        # What a digest has named, is asked for until one does not: its next one may not name it.
        most = self._settings.max_asks
        given_up = [r for r, n in peer.wanted.items() if n >= most and r not in peer.known]
        for route in given_up:
            self._drop_pending(peer, route)
            self._not_wanted(peer, route)
        if peer.wanted:
            self._asking.ask_wanted(peer, list(peer.wanted), self._now_ns)

    def _not_wanted(self, peer: Peer, route: int) -> None:
        """Its advertisement has come, or nobody will send it: who waited for it, goes on."""
        peer.wanted.pop(route, None)
        if not peer.wanted:
            self._alarms.cancel(("want", peer.origin, 0))
        found = peer.tracks.get(route)
        for content in self._take_pending(peer, route):
            if found is None:
                self._frames.unadvertised += 1
            else:
                self._place(peer, *found, content)
        for lane in [peer.tracks[patient][0] for patient in sorted(peer.patient)]:
            self._run(lane)

    def _take_pending(self, peer: Peer, route: int) -> list[Content]:
        contents = peer.pending.pop(route, [])
        self._held_bytes -= sum(map(content_bytes, contents))
        return contents

    def _drop_pending(self, peer: Peer, route: int) -> None:
        self._frames.unadvertised += len(self._take_pending(peer, route))

    # -- contents

    def _content(self, peer: Peer, content: Content) -> None:
        route = content.route
        known, found = peer.known.get(route), peer.tracks.get(route)
        if known is not None:
            known.next = max(known.next, content.seq + 1)
        if found is not None:
            self._place(peer, *found, content)
        elif known is not None and known.done:
            self._frames.again += 1
        elif self._has_room_for(peer, route):
            self._await_advertisement(peer, content)

    def _await_advertisement(self, peer: Peer, content: Content) -> None:
        if content.route not in peer.wanted and len(peer.wanted) >= self._settings.max_routes:
            self._frames.crowded += 1
            return
        if self._held_bytes + content_bytes(content) > self._settings.hold_bytes:
            self._frames.no_room += 1
        else:
            self._held_bytes += content_bytes(content)
            peer.pending.setdefault(content.route, []).append(content)
        peer.wanted.setdefault(content.route, 0)
        self._asking.ask_new(peer, self._now_ns)

    def _place(self, peer: Peer, lane: Lane, track: Track, content: Content) -> None:
        passes_at_once = track.may_be_next(content.seq) and self._may_pass(peer, lane, track)
        room = self._held_bytes + content_bytes(content) <= self._settings.hold_bytes
        was_asked = content.seq in track.outstanding
        before = track.held_bytes
        fate = Fate.ECHO if content.first in self._own else Fate.DELIVERED
        placed = track.place(content, fate, room=room or passes_at_once)
        self._held_bytes += track.held_bytes - before
        if placed is Placed.AGAIN:
            self._frames.again += 1
        elif placed is Placed.NO_ROOM:
            self._frames.no_room += 1
        else:
            track.asks = 0
        self._run(lane)
        if was_asked and not track.outstanding and track.is_missing() and self._asking.linked:
            self._asking.ask_for(peer, track, self._now_ns)
        if lane.head is track and track.flows:
            self._flow.add(lane, track, peer.known[content.route])

    # -- lanes

    def _begin_track(self, peer: Peer, one: Advertisement) -> None:
        track = Track(one, peer.start_of(one), self._now_ns)
        if one.route < peer.passed.get(one.name, 0):
            # A newer route of this topic has been let pass: older messages may not follow.
            track.announce(one.low, one.next)
            track.end(Fate.SKIPPED)
            track.pop()
            self._finish(peer, track)
            return
        lane = peer.lanes.get(one.name)
        if lane is None:
            self._last_lane += 1
            lane = Lane(self._last_lane, peer.origin, one.name, self._now_ns)
            peer.lanes[one.name] = self._lanes[lane.number] = lane
        lane.add(track)
        peer.tracks[one.route] = (lane, track)
        self._alarms.cancel(("bury", lane.number, 0))

    def _finish(self, peer: Peer, track: Track) -> None:
        route = track.advertised.route
        self._past.add(track.ledger)
        if track.advertised.epoch == peer.epoch:
            peer.tracks.pop(route, None)
            self._flow.remove(peer.origin, route)
            peer.patient.discard(route)
            self._asking.rest(peer.origin, route)
            self._alarms.cancel(("elder", peer.origin, route))
            if route in peer.known:
                peer.known[route].done = True

    def _run(self, lane: Lane) -> None:
        """Let pass what may pass, and see to what is missing."""
        peer = self._peers[lane.origin]
        while (head := lane.head) is not None:
            self._publishers.provide(lane, head, self._now_ns)
            self._drain(peer, lane, head)
            if not head.done:
                break
            lane.tracks.remove(head)
            self._finish(peer, head)
        if head is None:
            self._alarms.set_if_none(("bury", lane.number, 0), self._now_ns + self._settings.gap_ns)
        for track in lane.tracks:
            if track.advertised.epoch == peer.epoch:
                may_pass = lane.lets_pass(track) and track.advertised.route not in peer.patient
                stands_still = may_pass and track.cursor < track.next
                self._asking.care_for(peer.origin, track, self._now_ns, stands_still=stands_still)

    def _go_live(self, lane: Lane, cause: Cause) -> None:
        self._alarms.cancel(("lane", lane.number, 0))
        lane.move(cause, self._now_ns)
        for track in lane.tracks:
            track.asks = 0
        self._run(lane)

    def _drain(self, peer: Peer, lane: Lane, track: Track) -> None:
        if not self._may_pass(peer, lane, track):
            return
        before = track.held_bytes
        while (popped := track.pop()) is not None:
            content, fate = popped
            if fate is Fate.DELIVERED and not self._publishers.publish(lane, content):
                fate = Fate.REFUSED
            track.ledger.settle(fate)
        self._held_bytes += track.held_bytes - before
        if track.cursor > track.first and track.advertised.epoch == peer.epoch:
            peer.passed[lane.name] = track.advertised.route

    def _may_pass(self, peer: Peer, lane: Lane, track: Track) -> bool:
        return lane.lets_pass(track) and not self._waits_for_elders(peer, track)

    def _waits_for_elders(self, peer: Peer, track: Track) -> bool:
        """An older route may be of the same topic, and its messages come first."""
        if track.ended is not None:
            return False
        route = track.advertised.route
        patience_ns = track.born_ns + self._settings.gap_ns
        waits = (
            track.cursor == track.first
            and self._now_ns < patience_ns
            and any(one < route and one not in peer.tracks for one in peer.wanted)
        )
        if waits:
            peer.patient.add(route)
            self._alarms.set(("elder", peer.origin, route), patience_ns)
        elif route in peer.patient:
            peer.patient.discard(route)
            self._alarms.cancel(("elder", peer.origin, route))
        return waits

    # -- alarms

    def _rung(self, what: str, number: int, route: int) -> None:
        match what:
            case "hello":
                self._asking.need_hello(self._now_ns)
            case "want":
                self._ask_wanted(self._peers[number])
            case "lane":
                self._lane_rung(self._lanes[number])
            case "bury":
                self._bury(self._lanes[number])
            case _:
                self._track_rung(what, self._peers[number], route)

    def _lane_rung(self, lane: Lane) -> None:
        if lane.state is LaneState.WAIT_MATCH:
            self._go_live(lane, Cause.WAITED)
        elif lane.head is not None:
            self._publishers.create(lane, lane.head, self._now_ns)
            self._run(lane)
        else:
            # Whoever feeds it next has it tried again.
            lane.offers = None

    def _bury(self, lane: Lane) -> None:
        self._publishers.destroy(lane)
        lane.move(Cause.ENDED, self._now_ns)
        del self._lanes[lane.number]
        del self._peers[lane.origin].lanes[lane.name]

    def _track_rung(self, what: str, peer: Peer, route: int) -> None:
        lane, track = peer.tracks[route]
        if what == "ask":
            self._asking.ask_for(peer, track, self._now_ns)
        elif what == "gap":
            track.stop_waiting(self._asking.waited_before(peer.origin, route))
        self._run(lane)
