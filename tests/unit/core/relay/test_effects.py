from __future__ import annotations

from beacon_core.relay.effects import Arm, DestroyPublisher, Send


def test_effects_are_values() -> None:
    assert Arm(None) == Arm(None) != Arm(1)
    assert DestroyPublisher(1) != DestroyPublisher(2)
    assert Send(b"a", b"b").payload == b"b"
