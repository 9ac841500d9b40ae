"""What is asked of whom, and what follows; on nodes and a clock of the test's own."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import pytest

from beacon_core.hint import BeaconHint
from beacon_core.outcome import Outcome, Verdict
from beacon_core.parameters import asker as module
from beacon_core.parameters.asker import Asker
from beacon_core.parameters.fields import ENTITY_ID, MAX_PARAMETERS, PREFIX
from beacon_core.ports.asking import Done, Drop
from beacon_core.wire import json

MS = 1_000_000
SECOND = 1000 * MS

Call = tuple[Any, ...]


@attrs.frozen
class Settings:
    """As a configuration gives them, but faster."""

    interval_s: float = 1.0
    budget_s: float = 10.0
    timeout_s: float = 0.5
    max_in_flight: int = 128
    forget_after_s: float = 60.0


@attrs.define(eq=False)
class FakeNode:
    """A node, and the client that asks it."""

    parameters: dict[str, Any]
    gids: set[str]
    ready_now: bool = True
    hangs: bool = False
    strict: bool = False
    """Answers without values if one parameter has none, as rclpy does."""
    breaks: str = ""
    """Where it answers with an error: names, values, one by one; or raises: sending."""
    asked: int = 0
    looked: int = 0
    dropped: int = 0
    closed: int = 0
    pending: list[Callable[[], None]] = attrs.field(factory=list)

    def ready(self) -> bool:
        self.looked += 1
        return self.ready_now

    def list_names(self, done: Done) -> Drop:
        self.asked += 1
        if self.breaks == "sending":
            raise RuntimeError("the context is not valid")
        return self._answer(lambda: done(None if self.breaks == "names" else [*self.parameters]))

    def get_values(self, names: Sequence[str], done: Done) -> Drop:
        alone = "one by one" if len(names) == 1 else "values"
        return self._answer(lambda: done(None if self.breaks == alone else self._values(names)))

    def close(self) -> None:
        self.closed += 1

    def wake_up(self) -> None:
        self.hangs = False
        for answer in self.pending:
            answer()
        self.pending.clear()

    def _values(self, names: Sequence[str]) -> list[Any]:
        if self.strict and any(self.parameters.get(name) is None for name in names):
            return []
        return [self.parameters.get(name) for name in names]

    def _answer(self, answer: Callable[[], None]) -> Drop:
        if self.hangs:
            self.pending.append(answer)
        else:
            answer()
        return self._drop

    def _drop(self) -> None:
        self.dropped += 1


class Sink:
    """Takes everything, and writes it down."""

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.raises = 0
        self.verdict = Verdict.NEW

    def offer(self, payload: bytes, source: str, **envelope: Any) -> Outcome:
        self._maybe_raise()
        entity_id = getattr(json.decode(payload), "hint", BeaconHint("")).entity_id
        self.calls.append(("offer", entity_id, source, payload, envelope))
        return Outcome(self.verdict, entity_id if self.verdict is Verdict.NEW else "")

    def goodbye(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        self._maybe_raise()
        self.calls.append(("goodbye", entity_id, source, envelope))
        return Outcome(Verdict.LEFT, entity_id)

    def lost(self, entity_id: str, source: str, **envelope: Any) -> Outcome:
        self._maybe_raise()
        self.calls.append(("lost", entity_id, source, envelope))
        return Outcome(Verdict.LOST, entity_id)

    def take(self) -> list[tuple[str, str]]:
        """Kinds and entities of the calls since the last look."""
        short = [(call[0], call[1]) for call in self.calls]
        self.calls.clear()
        return short

    def _maybe_raise(self) -> None:
        if self.raises:
            self.raises -= 1
            raise RuntimeError("a fault in the sink")


class World:
    """Nodes, an asker, and the time."""

    def __init__(self, **options: Any) -> None:
        self.now_ns = 100 * SECOND
        self.nodes: dict[str, FakeNode] = {}
        self.opened: list[str] = []
        self.wakes = 0
        self.sink = Sink()
        self.asker = Asker(Settings(**options), self._open, self.sink, self._wake, self.now_ns)

    def add(self, name: str, hint_id: str = "", **parameters: Any) -> FakeNode:
        """A node with a hint, if an id is given, and a GID like its name."""
        ours = {f"{PREFIX}.{key}": value for key, value in parameters.items()}
        if hint_id:
            ours[ENTITY_ID] = hint_id
        self.nodes[name] = FakeNode({"use_sim_time": False, **ours}, {f"gid-{name}"})
        return self.nodes[name]

    def look(self, *wanted: str) -> None:
        """Hand in the graph; wanted are all if none are named."""
        runs = {name: node.gids for name, node in self.nodes.items()}
        self.asker.see(runs, wanted or runs, self.now_ns)

    def run(self, seconds: float = 0.0) -> None:
        """Let so much time pass, and do all that is due meanwhile, when it is due."""
        end_ns = self.now_ns + round(seconds * SECOND)
        while True:
            due_ns = self.asker.step(self.now_ns)
            if due_ns > end_ns and not self.asker._answers:
                break
            self.now_ns = max(self.now_ns, min(due_ns, end_ns))
        self.now_ns = end_ns

    def _open(self, name: str) -> FakeNode:
        self.opened.append(name)
        return self.nodes[name]

    def _wake(self) -> None:
        self.wakes += 1


# What an answer says


def test_a_node_with_a_hint_is_told_of_at_once_and_then_each_interval() -> None:
    world = World()
    world.add("/engine", "engine", display_name="Engine", process_id=7)
    world.look()
    world.run()
    ((kind, entity_id, source, payload, envelope),) = world.sink.calls
    assert (kind, entity_id, source) == ("offer", "engine", "/engine")
    assert payload == json.encode(BeaconHint("engine", display_name="Engine", process_id=7))
    assert envelope == {"incarnation": "gid-/engine", "sequence": 100 * SECOND}
    world.run(3.0)
    offers = world.sink.calls
    assert [call[3] for call in offers] == [payload] * 4
    assert [call[4]["sequence"] for call in offers] == [s * SECOND for s in (100, 101, 102, 103)]


def test_an_unchanged_answer_is_not_even_encoded_again(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World()
    world.add("/engine", "engine")
    world.look()
    world.run()
    monkeypatch.setattr(json, "encode", None)
    world.run(3.0)
    assert len({id(call[3]) for call in world.sink.calls}) == 1


def test_a_node_without_a_hint_is_asked_and_nothing_is_told() -> None:
    world = World()
    node = world.add("/plain")
    world.look()
    world.run(2.0)
    assert node.asked == 3
    assert not world.sink.calls
    assert world.asker.counters()["hints"] == 0


def test_what_a_node_has_besides_is_not_asked_for() -> None:
    world = World()
    node = world.add("/engine", "engine")
    node.strict, node.parameters["secret"] = True, None
    world.look()
    world.run()
    assert world.sink.take() == [("offer", "engine")]


def test_a_changed_hint_is_told_at_the_next_poll() -> None:
    world = World()
    node = world.add("/engine", "engine", display_name="cold")
    world.look()
    world.run()
    node.parameters[f"{PREFIX}.display_name"] = "warm"
    world.run(0.9)
    assert len(world.sink.calls) == 1
    world.run(0.1)
    assert b"warm" in world.sink.calls[-1][3]


def test_a_hint_that_is_gone_was_a_goodbye() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    node.parameters[ENTITY_ID] = ""
    world.run(3.0)
    assert world.sink.take() == [("offer", "engine"), ("goodbye", "engine")]
    node.parameters[ENTITY_ID] = "engine"
    world.run(1.0)
    assert world.sink.take() == [("offer", "engine")]
    assert world.asker.counters()["goodbyes"] == 1


def test_a_goodbye_is_numbered_after_all_that_was_said_before() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    del node.parameters[ENTITY_ID]
    world.run(1.0)
    *offers, goodbye = world.sink.calls
    assert goodbye[3]["incarnation"] == "gid-/engine"
    assert goodbye[3]["sequence"] > max(call[4]["sequence"] for call in offers)


def test_another_entity_id_is_a_goodbye_for_the_old_one() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    node.parameters[ENTITY_ID] = "motor"
    world.run(1.0)
    assert world.sink.take() == [("offer", "engine"), ("goodbye", "engine"), ("offer", "motor")]


def test_who_was_never_taken_is_not_said_goodbye_for() -> None:
    world = World()
    world.sink.verdict = Verdict.INVALID
    node = world.add("/engine", "no id!")
    world.look()
    world.run()
    node.parameters.clear()
    world.run(1.0)
    del world.nodes["/engine"]
    world.look()
    assert world.sink.take() == [("offer", "no id!")]


def test_a_parameter_without_a_value_costs_only_itself() -> None:
    world = World()
    node = world.add("/engine", "engine", display_name=None, hostname="robot")
    node.strict = True
    world.look()
    world.run(1.0)
    assert [call[3] for call in world.sink.calls] == [
        json.encode(BeaconHint("engine", hostname="robot"))
    ] * 2
    assert world.asker.counters()["skipped-parameters"] == 0


def test_a_node_with_very_many_parameters_is_asked_for_some() -> None:
    world = World()
    node = world.add("/greedy", "greedy")
    node.parameters.update({f"{PREFIX}.metadata.{n}": "x" for n in range(10_000)})
    world.look()
    world.run()
    (call,) = world.sink.calls
    assert call[3].count(b'"x"') == MAX_PARAMETERS - 1


def test_what_is_left_out_is_counted_and_said_once(caplog: pytest.LogCaptureFixture) -> None:
    world = World()
    node = world.add("/engine", "engine", display_name=7, colour="blue")
    world.look()
    with caplog.at_level(logging.WARNING):
        world.run(5.0)
    assert world.asker.counters()["skipped-parameters"] == 2
    assert len(caplog.messages) == 2
    assert caplog.messages[0].startswith(f"/engine: left out: '{PREFIX}.display_name'")
    node.parameters.pop(f"{PREFIX}.colour")
    world.run(1.0)
    assert world.asker.counters()["skipped-parameters"] == 1


def test_nodes_cannot_flood_the_log(caplog: pytest.LogCaptureFixture) -> None:
    world = World()
    for number in range(100):
        world.add(f"/n{number}", f"e{number}", display_name=7)
    world.look()
    with caplog.at_level(logging.WARNING):
        world.run(0.5)
    assert 1 <= len(caplog.messages) <= 25


# Who does not answer


def test_a_node_that_hangs_is_told_nothing_of_and_named_until_it_answers() -> None:
    world = World()
    node, other = world.add("/slow", "slow"), world.add("/quick", "quick")
    node.hangs = True
    world.look()
    world.run(0.4)
    assert world.sink.take() == [("offer", "quick")]
    assert world.asker.silent() == []
    world.run(0.2)
    assert world.asker.silent() == ["/slow"]
    assert node.dropped == 1
    world.run(1.5)
    assert set(world.sink.take()) == {("offer", "quick")}
    node.wake_up()
    world.run(3.0)
    assert ("offer", "slow") in world.sink.take()
    assert world.asker.silent() == []
    assert world.asker.counters()["failures"] >= 1
    assert not other.dropped


def test_an_answer_that_comes_too_late_is_ignored() -> None:
    world = World()
    node = world.add("/slow", "slow")
    node.hangs = True
    world.look()
    world.run(0.6)
    node.wake_up()
    world.run()
    assert not world.sink.calls


@pytest.mark.parametrize("stage", ["names", "values", "one by one", "sending"])
def test_a_node_that_answers_with_an_error_has_failed(stage: str) -> None:
    world = World()
    node = world.add("/broken", "broken", display_name=None)
    node.breaks, node.strict = stage, True
    world.look()
    world.run(0.4)
    assert world.asker.silent() == ["/broken"]
    assert not world.sink.calls


def test_a_node_that_failed_is_asked_only_if_somebody_is_there_to_answer() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    node.hangs = True
    world.run(1.6)
    node.hangs, node.ready_now = False, False
    asked = node.asked
    world.run(10.0)
    assert node.asked == asked
    node.ready_now = True
    world.run(10.0)
    assert node.asked > asked


def test_a_hung_node_holds_up_nobody() -> None:
    world = World(max_in_flight=4)
    for number in range(6):
        world.add(f"/hung{number}", "x").hangs = True
    for number in range(10):
        world.add(f"/live{number}", f"live{number}")
    world.look()
    world.run(20.0)
    for number in range(10):
        assert world.nodes[f"/live{number}"].asked >= 12


# Nodes come and go


def test_who_leaves_the_graph_is_lost_and_why_is_told() -> None:
    world = World()
    world.add("/engine", "engine")
    world.look()
    world.run()
    del world.nodes["/engine"]
    world.look()
    assert world.sink.calls[-1] == (
        "lost",
        "engine",
        "/engine",
        {"incarnation": "gid-/engine", "reason": "its node left the ROS graph"},
    )
    world.look()
    world.run(10.0)
    assert world.sink.take() == [("offer", "engine"), ("lost", "engine")]
    assert world.asker.counters()["lost"] == 1


def test_why_somebody_is_gone_may_be_told() -> None:
    world = World()
    world.add("/engine", "engine")
    world.look()
    world.run()
    world.asker.see({}, [], world.now_ns, why_gone="the cable is cut")
    assert world.sink.calls[-1][3]["reason"] == "the cable is cut"


def test_who_leaves_without_a_hint_is_no_loss() -> None:
    world = World()
    world.add("/plain")
    world.look()
    world.run()
    world.nodes.clear()
    world.look()
    assert not world.sink.calls


def test_a_poll_of_who_leaves_is_dropped() -> None:
    world = World()
    node = world.add("/engine", "engine")
    node.hangs = True
    world.look()
    world.run()
    world.nodes.clear()
    world.look()
    assert node.dropped == 1
    node.wake_up()
    world.run(1.0)
    assert not world.sink.calls


def test_who_was_started_again_is_lost_and_heard_anew_under_another_incarnation() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    node.gids = {"gid-2"}
    world.look()
    world.run()
    assert world.sink.calls[1][3]["reason"] == "its node was started again"
    assert world.sink.calls[2][4]["incarnation"] == "gid-2"
    assert world.sink.take() == [("offer", "engine"), ("lost", "engine"), ("offer", "engine")]


def test_the_clients_of_who_left_are_used_again_if_it_comes_back() -> None:
    world = World(forget_after_s=30.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    del world.nodes["/engine"]
    world.look()
    world.run(29.0)
    world.nodes["/engine"] = node
    world.look()
    world.run(60.0)
    assert world.opened == ["/engine"]
    assert not node.closed


def test_the_clients_of_who_left_are_closed_after_a_while() -> None:
    world = World(forget_after_s=30.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    del world.nodes["/engine"]
    world.look()
    world.run(29.9)
    closed_early = node.closed
    world.run(0.2)
    assert (closed_early, node.closed) == (0, 1)


def test_the_clients_of_who_came_back_and_cannot_be_asked_yet_are_kept() -> None:
    world = World(forget_after_s=30.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    del world.nodes["/engine"]
    world.look()
    node.ready_now, world.nodes["/engine"] = False, node
    world.look()
    world.run(60.0)
    assert not node.closed


def test_who_is_not_wanted_any_more_is_not_asked_and_nothing_is_told_of_it() -> None:
    world = World()
    node = world.add("/a", "a")
    world.add("/b", "b")
    world.look()
    world.run()
    world.sink.take()
    world.look("/b", "/not-there")
    asked = node.asked
    world.run(3.0)
    assert set(world.sink.take()) == {("offer", "b")}
    assert node.asked == asked
    world.nodes.clear()
    world.look()
    assert world.sink.take() == [("lost", "b")]


def test_more_nodes_than_can_be_asked_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MAX_TARGETS", 3)
    world = World()
    for number in range(5):
        world.add(f"/n{number}", f"e{number}")
    world.look()
    world.run(1.0)
    counters = world.asker.counters()
    assert (counters["targets"], counters["refused"]) == (3, 2)
    del world.nodes["/n0"], world.nodes["/n1"]
    world.look()
    world.run(1.0)
    counters = world.asker.counters()
    assert (counters["targets"], counters["refused"]) == (3, 0)


# Looking for services


def test_a_node_is_asked_as_soon_as_its_services_are_there() -> None:
    world = World()
    node = world.add("/late", "late")
    node.ready_now = False
    world.look()
    world.run(0.35)
    assert not node.asked
    assert world.asker.counters()["unreachable"] == 1
    node.ready_now = True
    world.run(0.35)
    assert world.sink.take() == [("offer", "late")]
    assert world.asker.counters()["unreachable"] == 0


def test_a_node_without_services_is_looked_at_ever_more_rarely_and_is_no_complaint() -> None:
    world = World(interval_s=5.0)
    node = world.add("/plain", "plain")
    node.ready_now = False
    world.look()
    world.run(60.0)
    assert 15 <= node.looked <= 25
    assert world.asker.silent() == []
    world.nodes.clear()
    world.look()
    assert node.closed == 1


def test_a_name_that_no_client_can_have_harms_nobody() -> None:
    world = World()
    world.add("/good", "good")
    gone = {"/good": {"gid"}}
    world.asker.see({"/bad name!": {"x"}, "/good": {"gid"}}, ["/bad name!", "/good"], world.now_ns)
    world.run(2.0)
    assert world.sink.take() == [("offer", "good")] * 3
    world.asker.see(gone, gone, world.now_ns)
    world.run(1.0)
    assert world.asker.counters()["unreachable"] == 0


def test_a_node_is_not_asked_before_its_gid_is_known_but_after_a_second_all_the_same() -> None:
    world = World()
    node, nameless = world.add("/known", "known"), world.add("/nameless", "nameless")
    node.gids, nameless.gids = set(), set()
    world.look()
    world.run(0.3)
    assert not world.sink.calls
    node.gids = {"gid"}
    world.look()
    world.run()
    assert [call[4]["incarnation"] for call in world.sink.calls] == ["gid"]
    world.sink.take()
    world.run(1.0)
    told = next(call for call in world.sink.calls if call[1] == "nameless")
    assert told[4] == {"incarnation": "", "sequence": 0}
    nameless.gids = {"late"}
    world.look()
    world.run(2.0)
    assert ("lost", "nameless") not in world.sink.take()


def test_two_nodes_of_one_name_are_told_of_without_saying_which_and_are_named() -> None:
    world = World()
    world.add("/twin", "twin").gids = {"one", "two"}
    world.look()
    world.run(2.0)
    assert world.asker.namesakes == ("/twin",)
    assert {call[4]["incarnation"] for call in world.sink.calls} == {""}
    world.nodes["/twin"].gids = {"two"}
    world.look()
    world.run(1.0)
    assert not world.asker.namesakes


def test_a_second_node_of_the_same_name_does_not_end_the_first() -> None:
    world = World()
    node = world.add("/twin", "twin")
    world.look()
    world.run()
    node.gids = {"gid-/twin", "another"}
    world.look()
    world.run(1.0)
    assert world.sink.take() == [("offer", "twin")] * 2


# Events


def test_a_change_that_an_event_tells_of_is_asked_for_at_once() -> None:
    world = World(interval_s=60.0)
    node = world.add("/engine", "engine", display_name="cold")
    world.look()
    world.run(1.0)
    node.parameters[f"{PREFIX}.display_name"] = "warm"
    assert world.asker.changed("/engine", world.now_ns)
    world.run(0.1)
    assert b"warm" in world.sink.calls[-1][3]
    assert world.asker.counters()["nudges"] == 1


def test_an_event_of_an_unknown_node_asks_for_a_look_at_the_graph() -> None:
    assert not World().asker.changed("/nobody", 0)


def test_a_flood_of_events_does_not_make_a_node_be_asked_without_end() -> None:
    world = World(interval_s=60.0)
    node = world.add("/busy", "busy")
    world.look()
    world.run(1.0)
    asked = node.asked
    for _ in range(1000):
        world.asker.changed("/busy", world.now_ns)
        world.run(0.001)
    assert 5 <= node.asked - asked <= 11


def test_many_events_in_a_row_end_in_one_poll_after_the_last() -> None:
    world = World(interval_s=60.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    world.sink.take()
    for number in range(10):
        node.parameters[f"{PREFIX}.metadata.k{number}"] = "v"
        world.asker.changed("/engine", world.now_ns)
        world.run(0.001)
    world.run(0.2)
    (call,) = world.sink.calls
    assert call[3].count(b'"v"') == 10


def test_a_hint_taken_back_by_a_node_that_still_answers_is_asked_for_first() -> None:
    world = World(interval_s=60.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    world.sink.take()
    world.asker.changed("/engine", world.now_ns, leaving=True)
    world.run(0.5)
    assert world.sink.take() == [("offer", "engine")]
    del world.nodes["/engine"]
    world.look()
    assert world.sink.take() == [("lost", "engine")]
    assert node.asked == 2


def test_a_hint_taken_back_by_a_node_that_leaves_before_it_is_asked_is_a_goodbye() -> None:
    world = World(interval_s=60.0)
    world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    world.asker.changed("/engine", world.now_ns, leaving=True)
    world.asker.changed("/engine", world.now_ns)
    del world.nodes["/engine"]
    world.look()
    assert world.sink.take() == [("offer", "engine"), ("goodbye", "engine")]


def test_a_hint_taken_back_and_given_again_is_no_goodbye() -> None:
    world = World(interval_s=60.0)
    world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    world.asker.changed("/engine", world.now_ns, leaving=True)
    world.asker.changed("/engine", world.now_ns, leaving=False)
    del world.nodes["/engine"]
    world.look()
    assert world.sink.take() == [("offer", "engine"), ("lost", "engine")]


def test_a_hint_taken_back_by_a_node_that_does_not_answer_any_more_is_a_goodbye() -> None:
    world = World(interval_s=60.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    node.hangs = True
    world.asker.changed("/engine", world.now_ns, leaving=True)
    world.run(1.0)
    assert world.sink.take() == [("offer", "engine"), ("goodbye", "engine")]
    world.nodes.clear()
    world.look()
    assert not world.sink.calls


def test_an_answer_from_before_an_event_does_not_contradict_it() -> None:
    world = World(interval_s=60.0)
    node = world.add("/engine", "engine")
    world.look()
    world.run(1.0)
    node.hangs = True
    world.asker.changed("/engine", world.now_ns)
    world.run(0.1)
    world.asker.changed("/engine", world.now_ns, leaving=True)
    node.wake_up()
    world.run()
    world.nodes.clear()
    world.look()
    assert world.sink.take()[-1] == ("goodbye", "engine")


# The sink, and the end


def test_a_sink_that_raises_is_counted_and_nothing_else_suffers(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world = World()
    world.sink.raises = 1
    world.add("/a", "a")
    world.add("/b", "b")
    world.look()
    world.run(1.0)
    assert {one for _, one in world.sink.take()} == {"a", "b"}
    assert world.asker.counters()["sink-errors"] == 1
    assert "a fault in the sink" in caplog.text


def test_a_goodbye_on_which_the_sink_raised_is_said_again() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.run()
    node.parameters.clear()
    world.sink.raises = 1
    world.run(2.0)
    assert world.sink.take() == [("offer", "engine"), ("goodbye", "engine")]


def test_who_is_stopped_tells_nothing_more() -> None:
    world = World()
    world.add("/engine", "engine")
    world.look()
    world.asker.stop()
    world.run(3.0)
    world.nodes.clear()
    world.look()
    assert not world.sink.calls


def test_closing_drops_what_is_under_way_and_closes_every_client() -> None:
    world = World()
    hung, gone = world.add("/hung", "hung"), world.add("/gone", "gone")
    unready = world.add("/unready")
    hung.hangs, unready.ready_now = True, False
    world.look()
    world.run()
    del world.nodes["/gone"]
    world.look()
    world.asker.close()
    assert hung.dropped == 1
    assert [node.closed for node in (hung, gone, unready)] == [1, 1, 1]


def test_closing_before_anybody_was_met_closes_nothing() -> None:
    world = World()
    node = world.add("/engine", "engine")
    world.look()
    world.asker.close()
    assert not node.looked
    assert not node.closed


def test_an_answer_wakes_the_owner_from_whatever_thread_it_comes() -> None:
    world = World()
    node = world.add("/engine", "engine")
    node.hangs = True
    world.look()
    world.run()
    assert world.wakes == 0
    node.wake_up()
    assert world.wakes == 1
