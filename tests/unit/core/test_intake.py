"""The one road in: every message ends in one verdict, and the short way is only shorter."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Callable

import attrs
import pytest

from beacon_core.clock import ManualClock
from beacon_core.errors import ConfigError
from beacon_core.hint import Announcement, BeaconHint
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.limits import MAX_PAYLOAD_BYTES, MAX_SOURCE_NAME, HintLimits
from beacon_core.outcome import Outcome, Refusal, Verdict
from beacon_core.ports.adapter import Malformed
from beacon_core.skew import SkewPolicy
from beacon_core.store import HintStore

S = 1_000_000_000


class CountingDecoder:
    """A small JSON decoder that counts how often it is needed."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, payload: bytes) -> Announcement | Malformed:
        self.calls += 1
        try:
            fields = json.loads(payload)
        except ValueError:
            return Malformed("$: not JSON")
        stamp_ns = fields.pop("stamp_ns", 0)
        repairs = tuple(fields.pop("repairs", ()))
        return Announcement(BeaconHint(**fields), stamp_ns, repairs)


@attrs.define
class Road:
    clock: ManualClock
    store: HintStore
    decode: CountingDecoder
    intake: Intake

    def offer(self, *, source: str = "r1", **fields: object) -> Outcome:
        return self.intake.offer(json.dumps(fields).encode(), source)


@pytest.fixture
def make() -> Callable[..., Road]:
    def make_road(**options: object) -> Road:
        clock, decode = ManualClock(), CountingDecoder()
        store = HintStore(clock, ttl_s=10, expiry_s=300)
        return Road(clock, store, decode, Intake(store, decode, **options))  # type: ignore[arg-type]

    return make_road


@pytest.fixture
def road(make: Callable[..., Road]) -> Road:
    return make()


def test_a_message_is_decoded_validated_and_stored(road: Road) -> None:
    outcome = road.offer(entity_id="a", hostname="h" * 600)
    assert outcome.verdict is Verdict.NEW
    assert outcome.accepted
    assert outcome.entity_id == "a"
    assert outcome.repairs == ("$.hostname: truncated 600 -> 512 bytes",)
    stored = road.store.get("a")
    assert stored is not None
    assert stored.hint.hostname == "h" * 512
    assert stored.source == "r1"


def test_an_equal_payload_refreshes_without_decoding(road: Road) -> None:
    road.offer(entity_id="a", hostname="h")
    road.clock.advance(3 * S)
    outcome = road.offer(entity_id="a", hostname="h")
    assert outcome == Outcome(Verdict.REFRESHED, "a")
    assert road.decode.calls == 1
    assert road.store.last_seen_ns("a") == road.clock.monotonic_ns()


def test_every_entity_of_a_source_is_refreshed_without_decoding(road: Road) -> None:
    for _ in range(3):
        for entity_id in "abcde":
            road.offer(entity_id=entity_id)
    assert road.decode.calls == 5
    assert road.intake.totals()[Verdict.REFRESHED] == 10


def test_a_payload_that_is_no_longer_the_last_word_is_decoded_again(road: Road) -> None:
    road.offer(entity_id="a", hostname="h1", process_id=1)
    road.offer(entity_id="a", hostname="h1", process_id=1, display_name="x")
    outcome = road.offer(entity_id="a", hostname="h1", process_id=1)
    assert road.decode.calls == 3
    # It does not say that there is no display name; so nothing has changed.
    assert outcome.verdict is Verdict.REFRESHED


def test_an_equal_payload_after_the_record_ended_begins_a_new_life(road: Road) -> None:
    road.offer(entity_id="a")
    road.store.forget("a")
    assert road.offer(entity_id="a").verdict is Verdict.NEW


def test_an_equal_payload_revives_a_stale_hint(road: Road) -> None:
    road.offer(entity_id="a")
    road.clock.advance(10 * S)
    stale = road.store.get("a")
    assert stale is not None
    assert stale.status is Status.STALE
    assert road.offer(entity_id="a").verdict is Verdict.REFRESHED
    active = road.store.get("a")
    assert active is not None
    assert active.status is Status.ACTIVE


def test_an_equal_payload_from_another_source_is_another_claim(road: Road) -> None:
    road.offer(entity_id="a", source="r1")
    road.offer(entity_id="a", source="r2")
    outcome = road.offer(entity_id="a", source="r1")
    assert outcome.verdict is Verdict.CONTENDED
    stored = road.store.get("a")
    assert stored is not None
    assert {claim.source for claim in stored.claims} == {"r1", "r2"}


def test_an_equal_payload_of_another_incarnation_is_a_restart(road: Road) -> None:
    payload = b'{"entity_id": "a"}'
    road.intake.offer(payload, "r1", incarnation="one", sequence=5)
    road.intake.offer(payload, "r1", incarnation="two", sequence=1)
    stored = road.store.get("a")
    assert stored is not None
    assert (stored.restarts, stored.incarnation) == (1, "two")


def test_a_repeated_sequence_number_changes_nothing(road: Road) -> None:
    payload = b'{"entity_id": "a"}'
    road.intake.offer(payload, "r1", incarnation="one", sequence=5)
    road.clock.advance(S)
    for sequence in (5, 4):
        outcome = road.intake.offer(payload, "r1", incarnation="one", sequence=sequence)
        assert outcome.verdict is Verdict.OLDER
    assert road.store.last_seen_ns("a") == road.clock.monotonic_ns() - S
    assert road.intake.offer(payload, "r1", incarnation="one", sequence=6).accepted


def test_a_payload_may_only_speak_for_whom_its_carrier_vouches(road: Road) -> None:
    payload = b'{"entity_id": "a"}'
    assert road.intake.offer(payload, "r1", entity_id="a").accepted
    outcome = road.intake.offer(payload, "r1", entity_id="b")
    assert outcome.verdict is Verdict.INVALID
    assert outcome.detail == "$.entity_id: 'a', but it may speak for 'b' only"
    assert road.intake.offer(payload, "r1", entity_id="a").verdict is Verdict.REFRESHED


def test_a_payload_with_a_stamp_of_its_own_is_read_each_time(road: Road) -> None:
    now = road.clock.wall_ns()
    road.offer(entity_id="a", stamp_ns=now - 3 * S)
    road.offer(entity_id="a", stamp_ns=now - 3 * S)
    assert road.decode.calls == 2
    assert road.store.last_seen_ns("a") == road.clock.monotonic_ns() - 3 * S


def test_a_stamp_beside_the_payload_keeps_the_short_way(road: Road) -> None:
    payload, ms = b'{"entity_id": "a"}', S // 1000
    for age in (500, 300):
        road.intake.offer(payload, "r1", stamp_ns=road.clock.wall_ns() - age * ms)
    assert road.decode.calls == 1
    assert road.store.last_seen_ns("a") == road.clock.monotonic_ns() - 300 * ms
    older = road.intake.offer(payload, "r1", stamp_ns=road.clock.wall_ns() - 400 * ms)
    assert older.verdict is Verdict.OLDER
    assert road.store.last_seen_ns("a") == road.clock.monotonic_ns() - 300 * ms


def test_a_replayed_message_of_a_source_with_a_good_clock_changes_nothing(road: Road) -> None:
    old = road.clock.wall_ns()
    for second in range(400):
        road.clock.advance(S)
        name = "v1" if second < 5 else "v2"
        road.offer(entity_id="a", display_name=name, stamp_ns=road.clock.wall_ns())
    assert road.offer(entity_id="a", display_name="v1", stamp_ns=old).verdict is Verdict.OLDER
    assert road.offer(entity_id="ghost", stamp_ns=old).verdict is Verdict.OLDER
    stored = road.store.get("a")
    assert stored is not None
    assert stored.hint.display_name == "v2"


def test_a_robot_with_a_slow_clock_is_active_while_it_talks(road: Road) -> None:
    for _ in range(10):
        road.clock.advance(S)
        road.offer(entity_id="a", stamp_ns=road.clock.wall_ns() - 30 * S)
    stored = road.store.get("a")
    assert stored is not None
    assert (stored.status, stored.last_seen_ns) == (Status.ACTIVE, road.clock.monotonic_ns())


@pytest.mark.parametrize("before_s", [0, 30, 3600, -30, -3600])
@pytest.mark.parametrize("after_s", [0, 30, 3600, -30, -3600])
def test_a_robot_whose_clock_is_set_or_ours_is_never_stale_while_it_talks(
    road: Road, before_s: int, after_s: int
) -> None:
    for beat in range(100):
        road.clock.advance(2 * S)
        ahead_s = before_s if beat < 50 else after_s
        road.offer(entity_id="a", stamp_ns=road.clock.wall_ns() + ahead_s * S)
        # Before its clock is known, a slow one may look as if its messages were late.
        stored = road.store.get("a")
        assert stored is not None
        assert beat < 3 or stored.status is Status.ACTIVE


def talk(road: Road, number: int, *, behind_ns: int) -> Verdict:
    """One beat of a robot whose clock is behind."""
    stamp_ns = road.clock.wall_ns() - behind_ns
    return road.intake.offer(
        b'{"entity_id": "a"}', "r1", stamp_ns=stamp_ns, incarnation="i", sequence=number
    ).verdict


@pytest.mark.parametrize(
    ("policy", "behind_ns", "silent_ns"),
    [
        # A clock that is measured to be off is corrected; a little could as well be delay.
        (SkewPolicy.AUTO, 5 * S, 0),
        (SkewPolicy.AUTO, 100 * S, 0),
        (SkewPolicy.AUTO, S * 8 // 10, S * 8 // 10),
        (SkewPolicy.STAMP, 5 * S, 5 * S),
        (SkewPolicy.ARRIVAL, 5 * S, 0),
        (SkewPolicy.AUTO, -5 * S, 0),
    ],
)
def test_after_a_loss_a_robot_is_back_when_its_stamps_as_far_as_believed_have_passed_it(
    make: Callable[..., Road], policy: SkewPolicy, behind_ns: int, silent_ns: int
) -> None:
    road = make(skew_policy=policy)
    for number in range(1, 6):
        talk(road, number, behind_ns=behind_ns)
        road.clock.advance(2 * S)
    assert road.intake.lost("a", "r1", incarnation="i").verdict is Verdict.LOST
    if silent_ns:
        road.clock.advance(silent_ns - 1)
        # A higher number proves that it is later than the last message, not than the loss.
        assert talk(road, 6, behind_ns=behind_ns) is Verdict.OLDER
        road.clock.advance(1)
    assert talk(road, 6, behind_ns=behind_ns) is Verdict.REFRESHED
    stored = road.store.get("a")
    assert stored is not None
    assert stored.status is Status.ACTIVE


def test_after_a_loss_a_robot_whose_clock_was_set_back_is_back_with_its_fourth_message(
    road: Road,
) -> None:
    for number in range(1, 6):
        talk(road, number, behind_ns=0)
        road.clock.advance(2 * S)
    road.intake.lost("a", "r1", incarnation="i")
    said = []
    for number in range(6, 10):
        road.clock.advance(S)
        said.append(talk(road, number, behind_ns=3600 * S))
    assert said == [Verdict.OLDER] * 3 + [Verdict.REFRESHED]


def test_what_comes_after_an_account_was_folded_away_is_counted_all_the_same(
    road: Road, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("beacon_core.sources.MAX_SOURCES", 10)
    decode, intake = road.decode, road.intake

    def fold_meanwhile(payload: bytes) -> Announcement | Malformed:
        monkeypatch.setattr(intake, "_decode", decode)
        road.clock.advance(S)
        for number in range(10):
            intake.offer(b"junk", f"other-{number}")
        assert "r1" not in {report.name for report in intake.sources()}
        return decode(payload)

    monkeypatch.setattr(intake, "_decode", fold_meanwhile)
    intake.offer(b"junk", "r1")
    assert sum(intake.totals().values()) == 11


def test_repairs_are_reported_each_time(road: Road) -> None:
    for _ in range(2):
        assert road.offer(entity_id="a", repairs=["$.x: mended"]).repairs == ("$.x: mended",)
    assert road.intake.sources()[0].repaired == 2


@pytest.mark.parametrize(
    ("payload", "verdict"),
    [
        (b"no hint", Verdict.MALFORMED),
        (b'{"entity_id": "a b"}', Verdict.INVALID),
        (bytes(MAX_PAYLOAD_BYTES + 1), Verdict.TOO_LARGE),
        (b'{"no_such_field": 1}', Verdict.FAULT),
    ],
)
def test_bad_input_is_a_verdict_with_a_detail(road: Road, payload: bytes, verdict: Verdict) -> None:
    outcome = road.intake.offer(payload, "r1")
    assert outcome.verdict is verdict
    assert not outcome.accepted
    assert outcome.detail
    assert road.intake.totals()[verdict] == 1
    assert road.store.size() == 0


def test_a_payload_of_exactly_the_limit_is_read(road: Road) -> None:
    payload = b'{"entity_id": "a"}'.ljust(MAX_PAYLOAD_BYTES)
    assert road.intake.offer(payload, "r1").verdict is Verdict.NEW


def test_limits_of_the_configuration_are_used(make: Callable[..., Road]) -> None:
    road = make(limits=HintLimits(max_string_length=3))
    assert road.offer(entity_id="a", hostname="robot").repairs


def test_a_loud_source_is_cut_to_its_rate_and_every_drop_counted(make: Callable[..., Road]) -> None:
    road = make(source_rate=10, global_rate=1000)
    verdicts = [road.offer(entity_id="a").verdict for _ in range(25)]
    assert verdicts.count(Verdict.SOURCE_RATE) == 15
    assert road.intake.totals()[Verdict.SOURCE_RATE] == 15
    assert road.offer(entity_id="b", source="r2").accepted
    road.clock.advance(S)
    assert road.offer(entity_id="a").accepted


def test_bad_input_is_charged_to_its_source(make: Callable[..., Road]) -> None:
    road = make(source_rate=100, global_rate=1000)
    verdicts = [road.intake.offer(b"junk", "r1").verdict for _ in range(20)]
    assert verdicts == [Verdict.MALFORMED] * 10 + [Verdict.SOURCE_RATE] * 10


def test_all_sources_together_are_limited_too(make: Callable[..., Road]) -> None:
    road = make(source_rate=10, global_rate=20)
    verdicts = [road.offer(entity_id="a", source=f"r{n}").verdict for n in range(40)]
    assert verdicts.count(Verdict.GLOBAL_RATE) > 0
    assert sum(road.intake.totals().values()) == 40


def test_goodbye_and_loss_reach_the_store_and_are_counted(road: Road) -> None:
    road.offer(entity_id="a")
    road.offer(entity_id="b")
    assert road.intake.goodbye("a", "r1").verdict is Verdict.LEFT
    assert road.intake.lost("b", "r1", reason="cable cut").verdict is Verdict.LOST
    a, b = road.store.get("a"), road.store.get("b")
    assert a is not None
    assert b is not None
    assert (a.status, b.status, b.detail) == (Status.LEFT, Status.STALE, "cable cut")
    assert road.offer(entity_id="a").verdict is Verdict.BURIED
    assert road.intake.goodbye("nobody", "r9").verdict is Verdict.UNKNOWN
    assert road.intake.lost("nobody", "r10").verdict is Verdict.UNKNOWN
    assert sum(road.intake.totals().values()) == 7


def test_an_announcer_that_closes_may_say_all_its_goodbyes_at_once(
    make: Callable[..., Road],
) -> None:
    road = make(source_rate=3)
    for entity_id in "abc":
        road.offer(entity_id=entity_id)
    for entity_id in "abc":
        assert road.intake.goodbye(entity_id, "r1").verdict is Verdict.LEFT


def test_what_carriers_say_of_a_sender_is_kept_short(road: Road) -> None:
    long, payload = "i" * 100_000, b'{"entity_id": "a"}'
    for sequence in (1, 2):
        assert road.intake.offer(payload, "r1", incarnation=long, sequence=sequence).accepted
    road.intake.lost("a", "r1", incarnation=long, reason=long)
    stored = road.store.get("a")
    assert stored is not None
    assert len(stored.incarnation) == len(stored.detail) == MAX_SOURCE_NAME
    assert road.intake.goodbye("a", "r1", incarnation=long, sequence=3).verdict is Verdict.LEFT


def test_a_full_store_is_a_verdict(make: Callable[..., Road]) -> None:
    clock = ManualClock()
    store = HintStore(clock, max_hints=1)
    intake = Intake(store, CountingDecoder())
    assert intake.offer(b'{"entity_id": "a"}', "r1").verdict is Verdict.NEW
    assert intake.offer(b'{"entity_id": "b"}', "r1").verdict is Verdict.STORE_FULL


def test_a_wrong_clock_is_measured_and_reported_once(
    road: Road, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        for _ in range(10):
            road.clock.advance(S)
            road.offer(entity_id="a", stamp_ns=road.clock.wall_ns() - 1000 * S)
    (line,) = caplog.messages
    assert line == "'r1': its clock is 1000.000 s behind ours; stamps are used by the policy 'auto'"
    (report,) = road.intake.sources()
    assert report.clock_offset_ns == 1000 * S
    assert report.distrusted_stamps == 10
    stored = road.store.get("a")
    assert stored is not None
    assert stored.status is Status.ACTIVE


def test_a_clock_that_is_ahead_is_reported_too(
    make: Callable[..., Road], caplog: pytest.LogCaptureFixture
) -> None:
    road = make(skew_policy=SkewPolicy.STAMP)
    with caplog.at_level(logging.WARNING):
        for _ in range(5):
            road.intake.offer(b'{"entity_id": "a"}', "r1", stamp_ns=road.clock.wall_ns() + 5 * S)
    assert caplog.messages == [
        "'r1': its clock is 5.000 s ahead of ours; stamps are used by the policy 'stamp'"
    ]


def test_one_thing_that_goes_on_is_logged_ever_more_rarely(
    make: Callable[..., Road], caplog: pytest.LogCaptureFixture
) -> None:
    road = make(source_rate=10, global_rate=10_000)
    with caplog.at_level(logging.WARNING):
        for _ in range(10 + 1000):
            road.offer(entity_id="a")
    counts = [line.split("(")[1].split()[0] for line in caplog.messages]
    assert counts == ["1", "10", "100", "1000"]


def test_many_sources_cannot_flood_the_log(road: Road, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        for number in range(1000):
            road.intake.offer(b"junk\n\x1b[31m", f"r{number}\n")
    assert 1 <= len(caplog.messages) <= 20
    assert all("\n" not in line and len(line) < 400 for line in caplog.messages)


@pytest.mark.parametrize("rate", [0.5, float("nan"), float("inf"), -1.0])
def test_impossible_rates_are_refused_by_name(make: Callable[..., Road], rate: float) -> None:
    with pytest.raises(ConfigError, match="source_rate"):
        make(source_rate=rate)
    with pytest.raises(ConfigError, match="global_rate"):
        make(global_rate=rate)


def test_threads_lose_no_count(make: Callable[..., Road]) -> None:
    road = make(source_rate=1e6, global_rate=1e6)

    def speak(name: str) -> None:
        for number in range(500):
            road.offer(entity_id=f"{name}-{number % 7}", source=name, display_name=str(number % 3))
            road.intake.offer(b"junk", name)

    threads = [threading.Thread(target=speak, args=(f"r{n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    totals = road.intake.totals()
    assert set(totals) == set(Verdict)
    assert road.intake.source_count() == 4
    assert sum(totals.values()) == 4 * 1000
    assert totals[Verdict.MALFORMED] == 4 * 500
    assert totals[Verdict.NEW] == 4 * 7
    assert road.store.size() == 28


def test_what_was_refused_is_told_by_verdict_with_the_latest_of_each(road: Road) -> None:
    assert road.intake.refusals() == {}
    road.offer(entity_id="a")
    road.intake.offer(b"no json", "r1")
    road.intake.offer(b"nor this", "r2")
    road.offer(source="r3", entity_id="no id!")
    assert road.intake.refusals() == {
        Verdict.MALFORMED: Refusal(2, "r2", "$: not JSON"),
        Verdict.INVALID: Refusal(1, "r3", road.intake.refusals()[Verdict.INVALID].detail),
    }
    assert "no id!" in road.intake.refusals()[Verdict.INVALID].detail


def test_a_late_word_is_no_refusal(road: Road) -> None:
    assert road.intake.goodbye("nobody", "r1").verdict is Verdict.UNKNOWN
    assert road.intake.refusals() == {}


def test_what_all_sources_may_still_say_can_be_asked(make: Callable[..., Road]) -> None:
    road = make(global_rate=50.0)
    assert road.intake.tokens() == 50
    road.offer(entity_id="a")
    assert road.intake.tokens() == 49


def test_the_time_since_the_last_message_is_known_whatever_became_of_it(
    make: Callable[..., Road],
) -> None:
    road = make(source_rate=1)
    assert road.intake.silence_ns() is None
    road.offer(entity_id="a")
    road.clock.advance(3 * S)
    assert road.intake.silence_ns() == 3 * S
    road.intake.offer(b"not JSON", "r1")
    assert road.intake.silence_ns() == 0
    road.clock.advance(S // 2)
    assert road.intake.offer(b"not JSON", "r1").verdict is Verdict.SOURCE_RATE
    assert road.intake.silence_ns() == 0
    road.clock.advance(S)
    road.intake.lost("a", "r1")
    assert road.intake.silence_ns() == S
    road.intake.goodbye("a", "r1")
    assert road.intake.silence_ns() == 0
