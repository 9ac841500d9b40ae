from __future__ import annotations

from beacon_core.relay.history import History
from beacon_core.relay.ledger import Fate, Ledger


def filled(count: int) -> tuple[History, Ledger]:
    ledger = Ledger()
    history = History(ledger)
    for _ in range(count):
        ledger.enter()
        history.keep(b"four", 0, 1, 0)
    return history, ledger


def test_numbers_are_given_without_gaps() -> None:
    history, _ = filled(3)
    assert (history.low, history.next, len(history)) == (0, 3, 3)
    assert history.held_bytes == 3 * 404
    assert [one.seq for one in history.run(1, 9)] == [1, 2]
    assert [one.seq for one in history.run(0, 2)] == [0, 1]


def test_the_oldest_goes_as_sent_if_it_was() -> None:
    history, ledger = filled(2)
    next(history.run(0, 1)).sent_ns = 0
    history.drop_oldest(Fate.EVICTED)
    history.drop_oldest(Fate.EVICTED)
    assert ledger.fates() == {Fate.SENT: 1, Fate.EVICTED: 1}
    assert (history.low, history.next, history.held_bytes) == (2, 2, 0)
    assert list(history.run(0, 9)) == []
