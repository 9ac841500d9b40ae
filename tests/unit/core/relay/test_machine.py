from __future__ import annotations

from beacon_core.relay.effects import Arm, DestroyPublisher, Effect
from beacon_core.relay.machine import Machine


class Egg(Machine[str]):
    def boil(self, now_ns: int, handle: int) -> list[Effect]:
        self._at(now_ns)
        self._alarms.set("done", self._now_ns + 5)
        self._effects.append(DestroyPublisher(handle))
        return self._done()

    def eat(self) -> list[Effect]:
        self._alarms.cancel("done")
        return self._done()


def test_what_is_to_be_done_is_handed_out_once_and_the_time_only_if_it_has_changed() -> None:
    egg = Egg(10)
    first = egg.boil(10, 1)
    assert first == [DestroyPublisher(1), Arm(15)]
    assert egg.boil(7, 2) == [DestroyPublisher(2)]
    assert egg.boil(11, 3) == [DestroyPublisher(3), Arm(16)]
    assert first == [DestroyPublisher(1), Arm(15)]
    assert egg.eat() == [Arm(None)]
    assert egg.eat() == []
