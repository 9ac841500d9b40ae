"""What the relay's two cores add to one message: the forwarder's side and the republisher's.

    python bench/relay_core.py

A message has no payload, which would not be touched anyway. Beside them runs the least that any
relay with this header must do: pack it, unpack it, and find the message's route in a table. The
ratios are to that; the times are of this machine, and for information.
"""

from __future__ import annotations

import cProfile
import struct
from collections.abc import Callable, Iterator

from beacon_core.relay.effects import CreatePublisher, Publish, Send
from beacon_core.relay.forwarder import Forwarder
from beacon_core.relay.forwarding import SeenTopic
from beacon_core.relay.frames import Advertisement, Digest, content_header, encode
from beacon_core.relay.names import NameMap, Rule
from beacon_core.relay.republisher import Republisher
from beacon_core.relay.settings import MESSAGE_OVERHEAD_BYTES, Forwarding, Republishing
from beacon_core.relay.values import Mode, Qos, TopicType
from measure import Report, best_ns, options

MESSAGES = 500
KIND = TopicType("std_msgs/msg/Empty", "RIHS01_1")
HEAD = struct.Struct("<BBBBQQIQqQ")
MANY = 2**40


def least() -> Callable[[], object]:
    """The header, and one look into a table."""
    routes = {(7, number): object() for number in range(20)}

    def run() -> None:
        for seq in range(MESSAGES):
            header = HEAD.pack(1, 2, 0, 0, 7, 1, 1, seq, seq, 7)
            _, _, _, _, origin, _, route, _, _, _ = HEAD.unpack_from(header)
            routes[origin, route]

    return run


def forwarding(mode: Mode, *, hold_bytes: int = MANY) -> Callable[[], object]:
    """Messages of one of 20 routes, with a link."""
    names = NameMap((Rule(allow=True, pattern="/**", mode=mode),))
    settings = Forwarding(hold_bytes=hold_bytes)
    core = Forwarder(origin=7, epoch=1, names=names, now_ns=0, settings=settings)
    core.link_up(0)
    for number in range(20):
        core.topic_seen(f"/topic/{number}", SeenTopic(KIND), 0)
    times: Iterator[int] = iter(range(1, MANY))
    assert [type(one) for one in core.message(1, b"", 0, stamp_ns=1)] == [Send]

    def run() -> None:
        message = core.message
        for now_ns, _ in zip(times, range(MESSAGES), strict=False):
            message(1, b"", now_ns, stamp_ns=now_ns)

    return run


def republishing(mode: Mode) -> Callable[[], object]:
    """Contents of one of 20 routes that is live; each the next one."""
    core = Republisher(asker=9, now_ns=0, settings=Republishing(match_ns=0))
    core.link_up(0)
    core.frame(*encode(Digest(7, 1, 1, 0, True, 0, (), 9, 1)), 0)
    for route in range(1, 21):
        advert = Advertisement(7, 1, route, 1 + route, 0, 0, 0, f"/t/{route}", KIND, Qos(), mode)
        assert CreatePublisher in map(type, core.frame(*encode(advert), 0))
    numbers = iter(range(MANY))

    def contents() -> list[tuple[int, bytes]]:
        some = (next(numbers) for _ in range(MESSAGES))
        return [(seq, content_header(7, 1, 1, seq, seq, 7, 0)) for seq in some]

    for seq, header in contents():
        assert [type(one) for one in core.frame(header, b"", seq)] == [Publish]

    def run() -> None:
        frame = core.frame
        for seq, header in contents():
            frame(header, b"", seq)

    return run


def headers() -> Callable[[], object]:
    """What :func:`republishing` spends on being told what has come."""
    numbers = iter(range(MANY))

    def run() -> None:
        some = (next(numbers) for _ in range(MESSAGES))
        for _ in [(seq, content_header(7, 1, 1, seq, seq, 7, 0)) for seq in some]:
            pass

    return run


def main() -> None:
    arguments = options()
    full = 100 * MESSAGE_OVERHEAD_BYTES
    subjects = {
        "least": least(),
        "headers": headers(),
        "forwarder, ordered": forwarding(Mode.ORDERED),
        "forwarder, ordered, as full as it may be": forwarding(Mode.ORDERED, hold_bytes=full),
        "forwarder, latest": forwarding(Mode.LATEST),
        "forwarder, state": forwarding(Mode.STATE),
        "forwarder, best effort": forwarding(Mode.BEST_EFFORT),
        "republisher, ordered": republishing(Mode.ORDERED),
        "republisher, best effort": republishing(Mode.BEST_EFFORT),
    }
    if arguments.profile:
        for name, subject in subjects.items():
            print(name)
            cProfile.runctx("for _ in range(100): subject()", {}, {"subject": subject}, None, 1)
        return
    best = best_ns(subjects, rounds=5 if arguments.quick else 200)
    basis, spent = best.pop("least"), best.pop("headers")
    report = Report("A message of 0 bytes, in either core")
    for name, ns in best.items():
        own = ns - spent if name.startswith("republisher") else ns
        report.ratio(f"{name} / pack, unpack and look up", own / basis)
        report.line(f"  ({own / MESSAGES / 1000:.2f} us a message)")
    report.finish(check=arguments.check)


if __name__ == "__main__":
    main()
