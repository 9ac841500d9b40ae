"""The validator, whatever the text is."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_core.hint import BeaconHint
from beacon_core.limits import MAX_LOG_CHARS, MAX_REPAIRS, HintLimits
from beacon_core.text import quoted
from beacon_core.validator import Accepted, Rejected, is_valid_id, validate

ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-"
# Limits that small texts reach: what matters happens around them, not at their size.
SMALL = HintLimits(
    max_id_length=6,
    max_string_length=7,
    max_function_ids=3,
    max_depends_on=4,
    max_metadata_entries=3,
    max_metadata_key_length=5,
    max_metadata_value_length=9,
)
LIMITS = st.sampled_from([SMALL, HintLimits()])

characters = st.one_of(
    st.sampled_from(ALPHABET),
    st.sampled_from("\n\x00 /.\x7f\u0661\u00b2\ufeff\u2028é日\N{GRINNING FACE}"),
    st.characters(),
    st.characters(categories=["Cs"]),
)
texts = st.text(characters, max_size=14)
ids = st.text(ALPHABET, min_size=1, max_size=8)
maybe_ids = ids | texts
hints = st.builds(
    BeaconHint,
    entity_id=maybe_ids,
    stable_id=maybe_ids,
    display_name=texts,
    function_ids=st.lists(maybe_ids, max_size=8).map(tuple),
    depends_on=st.lists(maybe_ids, max_size=8).map(tuple),
    component_id=maybe_ids,
    transport_type=texts,
    negotiated_format=texts,
    process_id=st.integers() | st.integers(0, 2**32 - 1),
    process_name=texts,
    hostname=texts,
    metadata=st.dictionaries(maybe_ids, texts, max_size=8),
)
tidy_ids = st.text(ALPHABET, min_size=1, max_size=5)
tidy_texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=14).filter(
    lambda text: len(text.encode()) <= 7
)
tidy_hints = st.builds(
    BeaconHint,
    entity_id=tidy_ids,
    stable_id=tidy_ids | st.just(""),
    display_name=tidy_texts,
    function_ids=st.lists(tidy_ids, max_size=3).map(tuple),
    depends_on=st.lists(tidy_ids, max_size=4).map(tuple),
    component_id=tidy_ids | st.just(""),
    transport_type=tidy_texts,
    negotiated_format=tidy_texts,
    process_id=st.integers(0, 2**32 - 1),
    process_name=tidy_texts,
    hostname=tidy_texts,
    metadata=st.dictionaries(tidy_ids, tidy_texts, max_size=3),
)
thorough = settings(deadline=None, max_examples=300)


@thorough
@given(hints, LIMITS)
def test_it_rejects_for_the_entity_id_alone(hint: BeaconHint, limits: HintLimits) -> None:
    verdict = validate(hint, limits)
    assert isinstance(verdict, Accepted) == is_id(hint.entity_id, limits.max_id_length)
    if isinstance(verdict, Rejected):
        assert verdict.reason.startswith("$.entity_id")
        assert verdict.reason.isprintable()
        assert verdict.reason.isascii()


@thorough
@given(hints, LIMITS)
def test_what_comes_out_is_within_all_limits(hint: BeaconHint, limits: HintLimits) -> None:
    verdict = validate(hint, limits)
    if isinstance(verdict, Accepted):
        assert_within(verdict.hint, limits)


@thorough
@given(hints, LIMITS)
def test_it_is_idempotent(hint: BeaconHint, limits: HintLimits) -> None:
    once = validate(hint, limits)
    if isinstance(once, Accepted):
        twice = validate(once.hint, limits)
        assert twice == Accepted(once.hint, ())
        assert isinstance(twice, Accepted)
        assert twice.hint is once.hint


@thorough
@given(hints, LIMITS)
def test_there_are_repairs_if_and_only_if_something_changed(
    hint: BeaconHint, limits: HintLimits
) -> None:
    verdict = validate(hint, limits)
    if isinstance(verdict, Accepted):
        assert (verdict.hint is hint) == (verdict.hint == hint) == (verdict.repairs == ())


@thorough
@given(tidy_hints, LIMITS)
def test_a_clean_hint_comes_back_as_the_same_object(hint: BeaconHint, limits: HintLimits) -> None:
    verdict = validate(hint, limits)
    assert isinstance(verdict, Accepted)
    assert verdict.hint is hint
    assert verdict.repairs == ()


@thorough
@given(hints, LIMITS)
def test_entries_keep_their_order_and_the_first_good_ones_stay(
    hint: BeaconHint, limits: HintLimits
) -> None:
    verdict = validate(hint, limits)
    if not isinstance(verdict, Accepted):
        return
    out = verdict.hint
    for before, after, cap in (
        (hint.function_ids, out.function_ids, limits.max_function_ids),
        (hint.depends_on, out.depends_on, limits.max_depends_on),
    ):
        assert after == tuple(t for t in before if is_id(t, limits.max_id_length))[:cap]
    good = [key for key in hint.metadata if is_id(key, limits.max_metadata_key_length)]
    assert list(out.metadata) == good[: limits.max_metadata_entries]


@thorough
@given(hints)
def test_kept_text_is_the_repaired_one_or_its_longest_beginning_that_fits(hint: BeaconHint) -> None:
    verdict = validate(hint, SMALL)
    if not isinstance(verdict, Accepted):
        return
    out = verdict.hint
    pairs = [
        (before, after, SMALL.max_string_length)
        for before, after in zip(free_texts(hint), free_texts(out), strict=True)
    ] + [
        (hint.metadata[key], value, SMALL.max_metadata_value_length)
        for key, value in out.metadata.items()
    ]
    for before, after, limit in pairs:
        whole = repaired(before)
        assert whole.startswith(after)
        assert after == whole or len(whole[: len(after) + 1].encode()) > limit


@thorough
@given(hints, LIMITS)
def test_repairs_are_few_short_and_fit_for_a_log(hint: BeaconHint, limits: HintLimits) -> None:
    verdict = validate(hint, limits)
    if isinstance(verdict, Accepted):
        assert len(verdict.repairs) <= MAX_REPAIRS
        for repair in verdict.repairs:
            assert repair.startswith(("$.", "... and "))
            assert len(repair) <= MAX_LOG_CHARS + 80
            assert repair.isprintable()
            assert repair.isascii()


@thorough
@given(st.text(characters, max_size=300))
def test_quoted_text_is_one_short_printable_line(text: str) -> None:
    shown = quoted(text)
    assert len(shown) <= MAX_LOG_CHARS
    assert shown.isprintable()
    assert shown.isascii()


@thorough
@given(maybe_ids)
def test_an_id_is_what_its_characters_say(text: str) -> None:
    assert is_valid_id(text) == is_id(text, 256)


def is_id(text: str, max_length: int) -> bool:
    return 0 < len(text) <= max_length and set(text) <= set(ALPHABET)


def repaired(text: str) -> str:
    return "".join("\ufffd" if "\ud800" <= char <= "\udfff" else char for char in text)


def free_texts(hint: BeaconHint) -> list[str]:
    return [
        hint.display_name,
        hint.transport_type,
        hint.negotiated_format,
        hint.process_name,
        hint.hostname,
    ]


def assert_within(hint: BeaconHint, limits: HintLimits) -> None:
    required = [hint.entity_id, *hint.function_ids, *hint.depends_on]
    optional = [text for text in (hint.stable_id, hint.component_id) if text]
    assert all(is_id(text, limits.max_id_length) for text in required + optional)
    assert all(is_id(key, limits.max_metadata_key_length) for key in hint.metadata)
    # encode() raises for what is not UTF-8.
    assert all(len(text.encode()) <= limits.max_string_length for text in free_texts(hint))
    values = hint.metadata.values()
    assert all(len(text.encode()) <= limits.max_metadata_value_length for text in values)
    assert len(hint.function_ids) <= limits.max_function_ids
    assert len(hint.depends_on) <= limits.max_depends_on
    assert len(hint.metadata) <= limits.max_metadata_entries
    assert 0 <= hint.process_id < 2**32
