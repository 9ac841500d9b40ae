"""Who may speak for whom over rmw_zenoh's keys: the recipe of docs/adapters/zenoh_rmw.md, tried
with robots that keep to it and one that does not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs
import pytest
import yaml
import zenoh

from beacon_core.hint import BeaconHint
from beacon_core.parameters.fields import ENTITY_ID, write
from beacon_core.ports.adapter import Adapter
from beacon_core.testing.harness import Listener
from beacon_core.wire import cdr
from beacon_zenoh.harness import free_endpoint
from beacon_zenoh.rmw import ADAPTER as TOPICS
from beacon_zenoh.rmw import RmwOptions, attachment
from beacon_zenoh.rmw.keys import data_key
from beacon_zenoh.rmw.lookalikes import open_session
from beacon_zenoh.rmw.qos import DEFAULT_QOS
from beacon_zenoh.rmw.session import hint_member, node_member
from beacon_zenoh.rmw.tokens import Kind, gid_of, token_key
from beacon_zenoh.rmw_param import ADAPTER as PARAMETERS
from beacon_zenoh.rmw_param import RmwParamOptions, messages
from beacon_zenoh.rmw_param.harness import RmwParamHarness
from beacon_zenoh.rmw_param.lookalikes import ParamRobot
from beacon_zenoh.rmw_param.messages import Event
from beacon_zenoh.rmw_param.services import GET, LIST, service_member

PAGE = Path(__file__).parents[2] / "docs/adapters/zenoh_rmw.md"

ROBOTS = ("r1", "r2")


def recipe() -> dict[str, Any]:
    """The access control on the page, of one robot."""
    blocks = re.findall(r"^```yaml\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    document = yaml.safe_load(next(one for one in blocks if "access_control" in one))
    (source,) = document["sources"].values()
    assert source["adapter"] == "zenoh_rmw_param"
    return dict(source["options"])


def access_control() -> dict[str, Any]:
    """The same for all robots."""
    control = recipe()["config"]["access_control"]
    text = yaml.safe_dump({name: control[name] for name in ("rules", "subjects", "policies")})
    merged: dict[str, Any] = {"rules": [], "subjects": [], "policies": []}
    for robot in ROBOTS:
        for name, entries in yaml.safe_load(text.replace("r1", robot)).items():
            merged[name] += entries
    return {**control, **merged}


class Gateway(RmwParamHarness):
    """A source that is its own router, and lets in two robots."""

    def __init__(self, adapter: Adapter, options: RmwOptions | RmwParamOptions) -> None:
        super().__init__()
        self.adapter, self._options = adapter, options
        self.listener = Listener(self).start()

    @property
    def endpoint(self) -> str:
        return self._options.listen[0]

    def options(self, network: int = 0) -> Any:
        return self._options

    def within(self, predicate: Any, what: str) -> None:
        assert self.wait_until(lambda: bool(predicate()), 5.0), f"not within 5 s: {what}"

    def counters(self) -> dict[str, int]:
        return dict(self.listener.source.health().counters)


def let_in(tmp_path: Path) -> dict[str, Any]:
    users = tmp_path / "users.txt"
    users.write_text("".join(f"{robot}:secret-{robot}\n" for robot in ROBOTS))
    return {
        "mode": "router",
        "listen": (free_endpoint(),),
        "users_file": str(users),
        "config": {"access_control": access_control()},
    }


def session_of(gateway: Gateway, robot: str) -> zenoh.Session:
    return open_session(gateway.endpoint, user=robot, password=f"secret-{robot}")


@pytest.fixture
def parameters(tmp_path: Path) -> Iterator[Gateway]:
    made = Gateway(PARAMETERS, RmwParamOptions(interval_s=0.1, **let_in(tmp_path)))
    yield made
    made.close()


def robot(gateway: Gateway, name: str, speaks_as: str = "") -> ParamRobot:
    return ParamRobot(
        "",
        write(BeaconHint(f"{name}-engine", display_name="true")),
        namespace=f"/fleet/{speaks_as or name}",
        session=session_of(gateway, name),
    )


def test_the_recipe_of_the_page_can_be_used() -> None:
    options = recipe()
    options["listen"] = tuple(options["listen"])
    RmwParamOptions(**options)


def test_each_robot_is_heard_under_its_own_namespace(parameters: Gateway) -> None:
    robots = [robot(parameters, name) for name in ROBOTS]
    for name in ROBOTS:
        parameters.within(lambda: parameters.listener.has(f"{name}-engine"), f"{name} is known")  # noqa: B023
    robots[0].close()
    parameters.within(
        lambda: not parameters.listener.has("r1-engine"), "the departure of r1 is seen"
    )
    assert parameters.listener.has("r2-engine")
    robots[1].close()


def test_a_robot_is_no_node_in_the_namespace_of_another(parameters: Gateway) -> None:
    evil = robot(parameters, "r1", speaks_as="r2")
    good = robot(parameters, "r2")
    parameters.within(lambda: parameters.listener.has("r2-engine"), "r2 is known")
    assert parameters.listener.status("r1-engine") is None
    assert parameters.counters()["nodes"] == 1
    assert not evil.asked
    for one in (evil, good):
        one.close()


def test_a_robot_cannot_answer_for_another(parameters: Gateway) -> None:
    good = robot(parameters, "r2")
    parameters.within(lambda: parameters.listener.has("r2-engine"), "r2 is known")
    evil = session_of(parameters, "r1")
    asked: list[str] = []

    def lie(query: zenoh.Query) -> None:
        asked.append(str(query.key_expr))
        with query:
            query.reply(query.key_expr, messages.encode_list_response([ENTITY_ID]))

    for service in (LIST, GET):
        key = data_key(service_member(good.node, 9, service).data_key)
        evil.declare_queryable(key, lie, complete=True)
    polls = parameters.counters()["polls"]
    parameters.within(lambda: parameters.counters()["polls"] > polls + 5, "r2 is asked further")
    assert not asked
    assert parameters.counters()["foreign-answers"] == 0
    assert parameters.listener.says("r2-engine", "true")
    evil.close()
    good.close()


def test_what_a_robot_declares_of_another_is_told_with_its_own_name(parameters: Gateway) -> None:
    """The keys bind the node, not what it says: that is for the conflict to show."""
    good = robot(parameters, "r2")
    parameters.within(lambda: parameters.listener.has("r2-engine"), "r2 is known")
    evil = robot(parameters, "r1")
    evil.parameters = write(BeaconHint("r2-engine", display_name="false"))
    evil.tell(Event("/fleet/r1/talker", changed={ENTITY_ID: "r2-engine"}))

    def claimants() -> set[str]:
        stored = parameters.listener.store.get("r2-engine")
        assert stored is not None
        return {claim.source for claim in stored.claims}

    both = {"/fleet/r1/talker", "/fleet/r2/talker"}
    parameters.within(lambda: claimants() == both, "both claim it, each under its own name")
    evil.close()
    good.close()


def test_over_the_common_topic_a_robot_is_heard_only_on_its_own(tmp_path: Path) -> None:
    topic = "/fleet/r1/discovery"
    gateway = Gateway(TOPICS, RmwOptions(topic=topic, **let_in(tmp_path)))
    try:
        sessions = {name: session_of(gateway, name) for name in ROBOTS}
        for name, session in sessions.items():
            node = node_member(0, str(session.zid()), 0, "talker")
            node = attrs.evolve(node, namespace=f"/fleet/{name}")
            publisher = hint_member(node, Kind.PUBLISHER, 1, topic, DEFAULT_QOS)
            gid = gid_of(token_key(publisher))
            for number in range(1, 4):
                session.put(
                    data_key(publisher.data_key),
                    cdr.encode(BeaconHint("r1-engine", display_name=name)),
                    attachment=attachment.encode(gid, number, number),
                )
        gateway.within(lambda: gateway.counters()["messages"] >= 3, "r1 is heard")
        assert gateway.listener.says("r1-engine", "r1")
        assert len(gateway.listener.intake.sources()) == 1
        for session in sessions.values():
            session.close()
    finally:
        gateway.close()
