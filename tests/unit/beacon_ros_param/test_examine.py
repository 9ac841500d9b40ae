"""Who is asked must have found the asker: Fast DDS cannot be made to be late with that."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there is nobody to ask")

from beacon_ros_param import examine


class Question:
    def __init__(self, answer: str | None) -> None:
        self.answer = answer

    def done(self) -> bool:
        return self.answer is not None

    def result(self) -> str | None:
        return self.answer


class Service:
    """Drops this many questions before it answers one."""

    def __init__(self, drops: int) -> None:
        self.drops = drops
        self.pending: list[Question] = []

    def service_is_ready(self) -> bool:
        return True

    def call_async(self, request: str) -> Question:
        self.pending.append(Question(f"answer to {request}" if not self.drops else None))
        self.drops -= 1
        return self.pending[-1]

    def remove_pending_request(self, question: Any) -> None:
        self.pending.remove(question)


def test_who_dropped_a_question_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examine, "_AGAIN_S", 0.05)
    services = {"/swift": Service(0), "/late": Service(2)}
    answers = examine._call(services, {"/swift": "a", "/late": "b"}, 30.0)
    assert answers == {"/swift": "answer to a", "/late": "answer to b"}
    assert services["/late"].drops == -1


def test_who_never_answers_is_given_up_and_nothing_is_left_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(examine, "_AGAIN_S", 0.05)
    service = Service(10**6)
    assert examine._call({"/mute": service}, {"/mute": "a"}, 0.3) == {}
    assert service.drops < 10**6 - 1
    assert service.pending == []
