from __future__ import annotations

from beacon_core.relay.history import History
from beacon_core.relay.ledger import Fate, Ledger


def filled(count: int) -> tuple[History, Ledger]:
    ledger = Ledger()
    history = History(ledger, 10**9, Fate.EVICTED)
    for _ in range(count):
        history.take(b"header", b"four", None)
    return history, ledger


def test_numbers_are_given_without_gaps() -> None:
    history, _ = filled(3)
    assert (history.low, history.next, len(history)) == (0, 3, 3)
    assert history.held_bytes == 3 * 404
    assert [one.seq for one in history.run(1, 9)] == [1, 2]
    assert [one.seq for one in history.run(0, 2)] == [0, 1]
    assert history.at(1).seq == 1


def test_only_so_many_are_kept_and_the_oldest_gives_way() -> None:
    ledger = Ledger()
    history = History(ledger, 2, Fate.CONFLATED)
    assert [history.take(b"header", b"four", sent_ns) for sent_ns in (None, 5)] == [404, 404]
    assert [history.take(b"header", b"123456", sent_ns) for sent_ns in (5, None)] == [2, 2]
    assert (history.low, history.next, history.held_bytes) == (2, 4, 2 * 406)
    assert ledger.fates() == {Fate.CONFLATED: 1, Fate.SENT: 1}
    assert ledger.held == 2


def test_where_none_is_kept_each_ends_at_once() -> None:
    ledger = Ledger()
    history = History(ledger, 0, Fate.UNLINKED)
    assert [history.take(b"header", b"four", sent_ns) for sent_ns in (5, None)] == [0, 0]
    assert (history.low, history.next, len(history), history.held_bytes) == (2, 2, 0, 0)
    assert ledger.fates() == {Fate.SENT: 1, Fate.UNLINKED: 1}
    assert ledger.held == 0


def test_the_oldest_goes_as_sent_if_it_was() -> None:
    history, ledger = filled(2)
    next(history.run(0, 1)).sent_ns = 0
    assert history.drop_oldest(Fate.EVICTED) == history.drop_oldest(Fate.EVICTED) == 404
    assert ledger.fates() == {Fate.SENT: 1, Fate.EVICTED: 1}
    assert (history.low, history.next, history.held_bytes) == (2, 2, 0)
    assert list(history.run(0, 9)) == []
