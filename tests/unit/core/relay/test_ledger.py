from __future__ import annotations

from beacon_core.relay.ledger import Fate, Ledger


def test_what_is_entered_and_not_settled_is_held() -> None:
    ledger = Ledger()
    ledger.enter()
    ledger.enter(4)
    ledger.settle(Fate.DELIVERED, 2)
    ledger.settle(Fate.EVICTED)
    assert (ledger.entered, ledger.held) == (5, 2)
    assert ledger.fates() == {Fate.DELIVERED: 2, Fate.EVICTED: 1}


def test_what_happened_to_none_is_not_named() -> None:
    ledger = Ledger()
    ledger.settle(Fate.ECHO, 0)
    assert ledger.fates() == {}


def test_what_ends_as_it_comes_is_held_at_no_time() -> None:
    ledger = Ledger()
    ledger.pass_on(Fate.SENT)
    ledger.pass_on(Fate.SENT)
    assert (ledger.entered, ledger.held, ledger.fates()) == (2, 0, {Fate.SENT: 2})


def test_ledgers_add_up() -> None:
    one, other = Ledger(), Ledger()
    one.enter(2)
    one.settle(Fate.SENT)
    other.enter(3)
    other.settle(Fate.SENT, 3)
    one.add(other)
    assert (one.entered, one.held, one.fates()) == (5, 1, {Fate.SENT: 4})
