"""Keys, tokens, QoS and attachments of rmw_zenoh: both ways for all that is legal, and no other."""

from __future__ import annotations

import string

import attrs
from hypothesis import given, settings
from hypothesis import strategies as st

from beacon_zenoh.rmw import attachment, keys, names, qos, tokens
from beacon_zenoh.rmw.keys import DataKey
from beacon_zenoh.rmw.publishers import Publishers
from beacon_zenoh.rmw.qos import FOREVER, Qos
from beacon_zenoh.rmw.tokens import Kind, Member

OFTEN = settings(max_examples=500, deadline=None)

LETTERS = string.ascii_letters
words = st.text(LETTERS + string.digits + "_", max_size=20)
simple_names = st.builds(lambda first, rest: first + rest, st.sampled_from(LETTERS + "_"), words)
full_names = (
    st.lists(simple_names, min_size=1, max_size=6)
    .map(lambda parts: "/" + "/".join(parts))
    .filter(lambda name: len(name) <= names.MAX_NAME_LENGTH)
)
namespaces = st.just("/") | full_names
type_words = st.builds(lambda first, rest: first + rest, st.sampled_from(LETTERS), words)
type_names = st.builds(
    lambda package, kind, name: f"{package}/{kind}/{name}",
    type_words,
    st.sampled_from(["msg", "srv", "action"]),
    type_words,
)
hashes = st.just("TypeHashNotSupported") | st.text(
    "0123456789abcdef", min_size=64, max_size=64
).map(lambda digits: f"RIHS01_{digits}")
domains = st.integers(0, keys.MAX_DOMAIN)
sizes = st.integers(0, 2**64 - 1)
durations = st.just(FOREVER) | st.tuples(sizes, sizes)
profiles = st.builds(
    Qos,
    reliability=st.integers(0, 4),
    durability=st.integers(0, 4),
    history=st.integers(0, 3),
    depth=st.just(42) | sizes,
    deadline=durations,
    lifespan=durations,
    liveliness=st.integers(0, 5),
    lease=durations,
)
data_keys = st.builds(DataKey, domains, full_names, type_names, hashes)
numbers = st.integers(0, 10**10 - 1)
zids = st.text("0123456789abcdef", min_size=1, max_size=32)


@st.composite
def members(draw: st.DrawFn) -> Member:
    kind, key, number = draw(st.sampled_from(Kind)), draw(data_keys), draw(numbers)
    node = Member(
        kind,
        key.domain,
        draw(zids),
        number,
        number if kind is Kind.NODE else draw(numbers),
        draw(simple_names),
        draw(namespaces),
        draw(namespaces),
    )
    if kind is Kind.NODE:
        return node
    return attrs.evolve(
        node,
        name=key.name,
        type_name=key.type_name,
        type_hash=key.type_hash,
        qos=draw(profiles),
    )


def explicit(profile: Qos) -> str:
    """The other spelling: nothing is left out."""
    sec_nanosec = [f"{sec},{nanosec}" for sec, nanosec in (profile.deadline, profile.lifespan)]
    return ":".join(
        [
            f"{profile.reliability}:{profile.durability}:{profile.history},{profile.depth}",
            *sec_nanosec,
            f"{profile.liveliness},{profile.lease[0]},{profile.lease[1]}",
        ]
    )


@st.composite
def damaged(draw: st.DrawFn, texts: st.SearchStrategy[str]) -> str:
    """Something legal with a piece cut out, doubled, or replaced by anything."""
    text = draw(texts)
    start = draw(st.integers(0, len(text)))
    end = draw(st.integers(start, len(text)))
    anything = st.text(st.characters(exclude_categories=()), max_size=8)
    piece = draw(anything | st.sampled_from(["", "/", "%", "::", text[start:end] * 2, "\n", "٣"]))
    return text[:start] + piece + text[end:]


@OFTEN
@given(full_names | st.just("/"))
def test_a_name_survives_being_a_chunk(name: str) -> None:
    assert names.unmangled(names.mangled(name)) == name
    assert "/" not in names.mangled(name)


@OFTEN
@given(type_names)
def test_a_type_survives_being_one_of_dds(type_name: str) -> None:
    assert names.is_type_name(type_name)
    assert names.ros_type(names.dds_type(type_name)) == type_name


@OFTEN
@given(profiles)
def test_both_spellings_of_a_profile_are_read_alike(profile: Qos) -> None:
    assert qos.decode(qos.encode(profile)) == profile
    assert qos.decode(explicit(profile)) == profile


@OFTEN
@given(data_keys)
def test_a_data_key_is_read_back(key: DataKey) -> None:
    text = keys.data_key(key)
    assert keys.data_key_of(text) == key
    assert "//" not in text
    assert text[0] + text[-1] != "//"


@OFTEN
@given(members())
def test_a_token_is_read_back(member: Member) -> None:
    key = tokens.token_key(member)
    assert tokens.member_of(key) == member
    assert len(tokens.gid_of(key)) == attachment.GID_BYTES


@OFTEN
@given(st.binary(min_size=16, max_size=16), st.integers(0, 2**63 - 1), st.integers(0, 2**63 - 1))
def test_an_attachment_is_read_back(gid: bytes, sequence: int, stamp_ns: int) -> None:
    written = attachment.encode(gid, sequence, stamp_ns)
    assert len(written) == 33
    assert attachment.decode(written) == (gid, sequence, stamp_ns)
    assert attachment.decode(written + b"more") == (gid, sequence, stamp_ns)


@OFTEN
@given(st.binary(max_size=80) | st.binary(min_size=33, max_size=45))
def test_any_bytes_beside_a_message_give_an_envelope_or_nothing(data: bytes) -> None:
    envelope = attachment.decode(data)
    if envelope is not None:
        gid, sequence, stamp_ns = envelope
        assert attachment.decode(attachment.encode(gid, sequence, stamp_ns)) == envelope


@OFTEN
@given(damaged(members().map(tokens.token_key)) | st.text(max_size=40))
def test_any_token_gives_a_member_that_is_legal_or_nothing(key: str) -> None:
    member = tokens.member_of(key)
    if member is not None:
        assert names.is_name(member.node_name) or len(member.node_name) > names.MAX_NAME_LENGTH
        assert names.is_namespace(member.enclave)
        assert tokens.member_of(tokens.token_key(member)) == member
        assert key.isascii()
    tokens.gid_of(key)


@OFTEN
@given(damaged(data_keys.map(keys.data_key)) | st.text(max_size=40))
def test_any_key_gives_a_topic_that_is_legal_or_nothing(key: str) -> None:
    found = keys.data_key_of(key)
    if found is not None:
        assert names.is_name(found.name)
        assert names.is_type_name(found.type_name)
        assert keys.data_key(found) == key


@OFTEN
@given(damaged(profiles.map(qos.encode)) | damaged(profiles.map(explicit)))
def test_any_text_gives_a_profile_or_nothing(text: str) -> None:
    profile = qos.decode(text)
    if profile is not None:
        assert qos.decode(qos.encode(profile)) == profile


NOBODY = [bytes([number]) * 16 for number in range(2)]
TOKENS = [
    Member(Kind.PUBLISHER, 0, zid, 0, number, "n", "/", "/", "/hints", "a/msg/B", "RIHS01_0")
    for zid, number in (("aa", 1), ("aa", 2), ("bb", 1))
]
GIDS = [tokens.gid_of(tokens.token_key(one)) for one in TOKENS]
TOPIC_KEY = keys.data_key(TOKENS[0].data_key)
STEPS = st.lists(
    st.tuples(st.sampled_from(["listed", "unlisted"]), st.integers(0, 2))
    | st.tuples(st.just("heard"), st.integers(0, 4))
    | st.tuples(st.just("settle"), st.just(0)),
    max_size=40,
)


@OFTEN
@given(STEPS)
def test_nobody_is_lost_while_the_token_that_is_its_by_number_is_there(
    steps: list[tuple[str, int]],
) -> None:
    known, listed, now_ns = Publishers(), set[int](), 0
    for what, number in steps:
        now_ns += 10**8
        if what == "listed":
            known.listed(GIDS[number], TOKENS[number], now_ns)
            listed.add(number)
        elif what == "unlisted":
            listed.discard(number)
            lost = {one.name for one in known.unlisted(GIDS[number])}
            assert not lost & {GIDS[one].hex() for one in listed}
        elif what == "heard":
            gid = [*GIDS, *NOBODY][number]
            known.meet(gid, TOPIC_KEY, "aa", now_ns)
        else:
            known.settle(now_ns + 10**10)
        check_ties(known, listed)


def check_ties(known: Publishers, listed: set[int]) -> None:
    """Each token is one publisher's at most, and its own once it was heard."""
    owners = [one.token for one in known.heard.values() if one.token is not None]
    assert len(owners) == len(set(owners))
    assert set(owners) <= {GIDS[one] for one in listed}
    for number in listed:
        if GIDS[number] in known.heard:
            assert known.heard[GIDS[number]].token == GIDS[number]
