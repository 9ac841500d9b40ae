"""Who speaks under an id: which evidence tells two processes apart, and what numbers prove."""

from __future__ import annotations

from typing import Any

import pytest

from beacon_core.claims import (
    Claimant,
    claimed_bytes,
    count_after,
    find,
    follows,
    freshest_contender,
    is_new_life,
    last_seen,
    noted,
    other_host,
    remembered,
    repeats,
    same_claimant,
    seen_to_go,
    succession,
    told_before,
    visible,
)
from beacon_core.hint import BeaconHint
from beacon_core.limits import HINT_OVERHEAD_BYTES, MAX_FORMER_RUNS


def one(
    source: str = "s",
    incarnation: str = "",
    sequence: int = 0,
    *,
    host: str = "",
    process: int = 0,
    at_ns: int = 0,
    contending: bool = False,
    **words: Any,
) -> Claimant:
    hint = BeaconHint("e", hostname=host, process_id=process, **words)
    return Claimant(hint, source, incarnation, sequence, at_ns, contending=contending)


# -- the same process, or another ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "known", "same"),
    [
        pytest.param(one("a"), one("a"), True, id="same source"),
        pytest.param(one("a"), one("b"), False, id="other source"),
        pytest.param(one(""), one("b", "i", host="h", process=1), True, id="no claim at all"),
        pytest.param(one("a"), one(""), False, id="a claim on what nobody claimed"),
        # The incarnation decides, whatever else there is.
        pytest.param(
            one("a", "i", host="h", process=1),
            one("b", "i", host="g", process=2),
            True,
            id="same incarnation, all else differs",
        ),
        pytest.param(
            one("a", "i", host="h", process=1),
            one("a", "j", host="h", process=1),
            False,
            id="other incarnation, all else equal",
        ),
        pytest.param(one("a", "i"), one("a"), True, id="only one tells an incarnation"),
        pytest.param(one("b", "i"), one("a"), False, id="the same from another source"),
        # Then host and process id.
        pytest.param(one("a", host="h"), one("a", host="g"), False, id="other host"),
        pytest.param(one("a", host="h"), one("a"), True, id="only one tells a host"),
        pytest.param(one("a", process=1), one("a", process=2), False, id="other process id"),
        pytest.param(one("a", process=1), one("a"), True, id="only one tells a process id"),
        pytest.param(
            one("a", host="h", process=1),
            one("b", host="h", process=1),
            True,
            id="same process by another way",
        ),
        pytest.param(
            one("a", host="h", process=1),
            one("b", process=1),
            False,
            id="equal process ids prove nothing without a host",
        ),
        pytest.param(
            one("a", host="h"), one("b", host="h"), False, id="an equal host proves nothing"
        ),
    ],
)
def test_the_strongest_evidence_that_both_give_decides(
    message: Claimant, known: Claimant, *, same: bool
) -> None:
    assert same_claimant(message, known) is same


@pytest.mark.parametrize(
    ("host", "other", "differ"),
    [("h", "g", True), ("h", "h", False), ("h", "", False), ("", "g", False), ("", "", False)],
)
def test_hosts_differ_if_both_are_told_and_not_equal(
    host: str, other: str, *, differ: bool
) -> None:
    assert other_host(one(host=host), one(host=other)) is differ


# -- what numbers prove --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "known", "repeated", "newer"),
    [
        pytest.param(one("s", "i", 5), one("s", "i", 5), True, False, id="equal"),
        pytest.param(one("s", "i", 4), one("s", "i", 5), True, False, id="lower"),
        pytest.param(one("s", "i", 6), one("s", "i", 5), False, True, id="higher"),
        pytest.param(one("s", "i", 0), one("s", "i", 5), False, False, id="no number"),
        pytest.param(one("s", "i", 5), one("s", "i", 0), False, False, id="none known"),
        pytest.param(one("s", "j", 4), one("s", "i", 5), False, False, id="other incarnation"),
        pytest.param(one("s", "j", 6), one("s", "i", 5), False, False, id="other, higher"),
        pytest.param(one("s", "", 4), one("s", "", 5), False, False, id="no incarnation"),
        pytest.param(one("s", "", 6), one("s", "", 5), False, False, id="no incarnation, higher"),
    ],
)
def test_numbers_count_within_one_incarnation(
    message: Claimant, known: Claimant, *, repeated: bool, newer: bool
) -> None:
    assert repeats(message, known) is repeated
    assert follows(message, known) is newer


@pytest.mark.parametrize(
    ("message", "known", "expected"),
    [
        pytest.param(one("s", "i", 6), one("s", "i", 5), ("i", 6), id="the next"),
        pytest.param(one("s", "i", 0), one("s", "i", 5), ("i", 5), id="without a number"),
        pytest.param(one("s", "j", 1), one("s", "i", 5), ("j", 1), id="a new incarnation"),
        pytest.param(one("s", "i", 1), one("s", "", 5), ("i", 1), id="tells its incarnation"),
        pytest.param(one("s", "", 9), one("s", "i", 5), ("i", 5), id="a number of nobody"),
        pytest.param(one("s", "", 1), one("s", "", 5), ("", 1), id="nobody ever tells"),
        pytest.param(one("s", "", 0), one("s", "", 5), ("", 5), id="nobody tells anything"),
    ],
)
def test_the_count_is_kept_through_messages_that_say_nothing_about_it(
    message: Claimant, known: Claimant, expected: tuple[str, int]
) -> None:
    assert count_after(known, message) == expected


@pytest.mark.parametrize(
    ("message", "departed", "new"),
    [
        pytest.param(one("s", "i", 6), one("s", "i", 5), True, id="a higher number"),
        pytest.param(one("s", "", 6), one("s", "", 5), True, id="also without incarnations"),
        pytest.param(one("s", "i", 5), one("s", "i", 5), False, id="the goodbye's own number"),
        pytest.param(one("s", "i", 4), one("s", "i", 5), False, id="a lower number"),
        pytest.param(one("s", "i", 6), one("s", "i", 0), False, id="nothing to compare with"),
        pytest.param(one("s", "i", 6), one("s", "", 5), False, id="numbers of different things"),
        pytest.param(one("s"), one("s"), False, id="no numbers"),
        pytest.param(one(""), one("s"), False, id="no claim"),
        pytest.param(one("s", "j"), one("s", "i"), True, id="another incarnation"),
        pytest.param(one("s", process=2), one("s", process=1), True, id="another process"),
        pytest.param(one("s", host="g"), one("s", host="h"), True, id="another host"),
        pytest.param(one("t"), one("s"), True, id="another source"),
    ],
)
def test_a_life_after_a_goodbye_needs_proof(
    message: Claimant, departed: Claimant, *, new: bool
) -> None:
    assert is_new_life(message, departed) is new


# -- among rivals --------------------------------------------------------------------------------


def test_the_rival_is_found_for_whom_somebody_speaks() -> None:
    rivals = [one("a", "i"), one("b", "j")]
    assert find(rivals, one("c", "j")) is rivals[1]
    assert find(rivals, one("c", "k")) is None
    assert find([], one("c")) is None


def test_the_contender_that_was_heard_last_is_next() -> None:
    rivals = [
        one("a", at_ns=1, contending=True),
        one("b", at_ns=3, contending=True),
        one("c", at_ns=2, contending=True),
        one("d", at_ns=4),
    ]
    assert freshest_contender(rivals) is rivals[1]
    assert [last_seen(rival) for rival in rivals] == [1, 3, 2, 4]


@pytest.mark.parametrize("rivals", [[], [one("a")]])
def test_nobody_is_next_if_nobody_contends(rivals: list[Claimant]) -> None:
    assert freshest_contender(rivals) is None


def test_contenders_are_seen_with_their_words_and_predecessors_are_not() -> None:
    rivals = [one("a", "i", 1, at_ns=1, contending=True, display_name="A"), one("b")]
    assert visible(rivals) == [(rivals[0].hint, "a", "i")]
    heard_again = one("a", "i", 2, at_ns=9, contending=True, display_name="A")
    assert visible([heard_again]) == visible(rivals)


def test_contenders_are_accounted_for_and_predecessors_are_not() -> None:
    rivals = [one("a", contending=True, display_name="1234"), one("b", display_name="123")]
    assert claimed_bytes(rivals) == HINT_OVERHEAD_BYTES + len("e" + "1234")
    assert claimed_bytes([]) == 0


def test_a_predecessor_is_remembered_by_who_it_was_without_its_other_words() -> None:
    known = one("a", "i", 5, host="h", process=7, at_ns=9, display_name="A", depends_on=("b",))
    kept = remembered(known)
    assert (kept.source, kept.incarnation, kept.sequence, kept.last_seen_ns) == ("a", "i", 5, 9)
    assert kept.hint == BeaconHint("e", hostname="h", process_id=7)
    assert not kept.contending


@pytest.mark.parametrize(
    ("goodbye", "count"),
    [
        (one("a", "i", 7, at_ns=20), ("i", 7)),
        (one("a", "i", at_ns=20), ("i", 5)),
        (one("a", at_ns=20), ("i", 5)),
    ],
)
@pytest.mark.parametrize("by_goodbye", [True, False])
def test_of_one_who_went_it_is_kept_who_when_how_and_with_which_number(
    goodbye: Claimant, count: tuple[str, int], *, by_goodbye: bool
) -> None:
    known = one("a", "i", 5, host="h", at_ns=9, contending=True, display_name="A")
    gone = seen_to_go(known, goodbye, goodbye=by_goodbye)
    assert (gone.source, gone.incarnation, gone.sequence) == ("a", *count)
    assert (gone.last_seen_ns, gone.departed, gone.contending) == (20, by_goodbye, False)
    assert gone.hint == BeaconHint("e", hostname="h")


def test_of_former_runs_the_highest_number_is_known() -> None:
    runs = noted((("i", 5), ("j", 1)), [("i", 3), ("k", 2)])
    assert runs == (("j", 1), ("i", 5), ("k", 2))
    assert noted(runs, [("j", 7)]) == (("i", 5), ("k", 2), ("j", 7))


def test_a_run_without_a_name_or_a_number_is_none_to_remember() -> None:
    assert noted((), [("", 5), ("i", 0)]) == ()


def test_the_runs_that_went_first_are_forgotten_first() -> None:
    runs = noted((), [(f"i{n}", 1) for n in range(MAX_FORMER_RUNS + 2)])
    assert runs == tuple((f"i{n}", 1) for n in range(2, MAX_FORMER_RUNS + 2))


@pytest.mark.parametrize(
    ("message", "told"),
    [
        (one("a", "i", 5), True),
        (one("b", "i", 1), True),
        (one("a", "j", 2), True),
        (one("a", "i", 6), False),
        (one("a", "i", 0), False),
        (one("a", "k", 1), False),
        (one("a", "", 1), False),
    ],
)
def test_what_a_former_run_has_said_before_is_known_by_its_number(
    message: Claimant, *, told: bool
) -> None:
    assert told_before(message, (("i", 5), ("j", 2))) is told


@pytest.mark.parametrize(
    ("heir", "words"),
    [
        (one("a", "i", host="h", process=1), "the same process again"),
        (one("a", "j", host="h", process=1), "another incarnation"),
        (one("b", "i", host="h", process=2), "another process id, source"),
        (one("b", "j", host="g", process=2), "another incarnation, host, process id, source"),
        # What one of the two has not given cannot differ.
        (one("b", "", host="g", process=0), "another host, source"),
        (one("b"), "another source"),
        (one("a"), "the same process again"),
        (one(""), "the same process again"),
    ],
)
def test_a_succession_is_told_in_words(heir: Claimant, words: str) -> None:
    assert succession(one("a", "i", host="h", process=1), heir) == words


def test_a_succession_of_somebody_who_never_said_who_it_was_names_no_difference() -> None:
    assert succession(one(""), one("a", "i", host="h", process=1)) == "the first to claim it"
    assert succession(one("", "i"), one("a", "i")) == "the same process again"
    same_process = one("a", host="h", process=1)
    assert succession(one("", host="h", process=1), same_process) == "the same process again"
