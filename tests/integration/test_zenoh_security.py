"""Who may speak, and for whom: the recipes of docs/adapters/zenoh.md, tried with true and false
credentials."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs
import pytest
import yaml
import zenoh

from beacon_core.clock import SystemClock
from beacon_core.hint import BeaconHint
from beacon_core.intake import Intake
from beacon_core.lifecycle import Status
from beacon_core.outcome import Verdict
from beacon_core.ports.health import Condition
from beacon_core.store import HintStore
from beacon_core.testing.harness import RealTimeHarness
from beacon_core.wire import json
from beacon_zenoh import TlsOptions, ZenohOptions
from beacon_zenoh.announcer import ZenohAnnouncer
from beacon_zenoh.config import session_config
from beacon_zenoh.harness import ProcessAnnouncer, free_endpoint
from beacon_zenoh.source import ZenohSource

AN_HOUR_S = 3600.0

OPENSSL = shutil.which("openssl")


PAGE = Path(__file__).parents[2] / "docs/adapters/zenoh.md"


def block(language: str, holding: str) -> str:
    """The recipe on the page that holds these words."""
    found = re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE
    )
    return next(str(one) for one in found if holding in one)


def access_for(subjects: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The recipe: each robot may speak for the entity of its own name, and be asked."""
    control: dict[str, Any] = {"enabled": True, "default_permission": "deny"}
    control |= {"rules": [], "subjects": [], "policies": []}
    for robot, subject in subjects.items():
        rules = [
            {
                "id": f"{robot}-speaks",
                "permission": "allow",
                "flows": ["ingress"],
                "messages": ["put", "delete", "reply", "declare_queryable"],
                "key_exprs": [f"beacon/hint/{robot}"],
            },
            {
                "id": f"{robot}-lives",
                "permission": "allow",
                "flows": ["ingress"],
                "messages": ["liveliness_token"],
                "key_exprs": [f"beacon/live/{robot}/**"],
            },
            {
                "id": f"{robot}-is-asked",
                "permission": "allow",
                "flows": ["egress"],
                "messages": ["query"],
                "key_exprs": ["beacon/hint/*"],
            },
        ]
        control["rules"] += rules
        control["subjects"].append({"id": robot, **subject})
        control["policies"].append(
            {"subjects": [robot], "rules": [str(rule["id"]) for rule in rules]}
        )
    return {"access_control": control}


class Gateway:
    """A source with a store behind it."""

    def __init__(self, options: ZenohOptions) -> None:
        self.options = options
        self.wait_until = RealTimeHarness().wait_until
        self.start()

    def start(self) -> None:
        self.store = HintStore(SystemClock(), ttl_s=600.0)
        self.intake = Intake(self.store, json.decode)
        self.source = ZenohSource(self.options)
        self.source.start(self.intake)

    def restart(self) -> None:
        self.source.close()
        # Closing does not wait for Zenoh for ever: the port may still be taken.
        self.source._keeper._thread.join(30)
        self.start()

    def status(self, entity_id: str) -> Status | None:
        stored = self.store.get(entity_id)
        return None if stored is None else stored.status

    def hint(self, entity_id: str) -> BeaconHint:
        stored = self.store.get(entity_id)
        assert stored is not None
        return stored.hint

    def says_the_truth_about(self, entity_id: str) -> None:
        stored = self.store.get(entity_id)
        assert stored is not None
        assert stored.status is Status.ACTIVE
        assert stored.hint.display_name == "true"
        assert not stored.conflict

    def becomes(self, entity_id: str, status: Status, seconds: float = 5.0) -> None:
        self.within(lambda: self.status(entity_id) is status, f"{entity_id} is {status}", seconds)

    def within(self, predicate: Callable[[], bool], what: str, seconds: float = 5.0) -> None:
        assert self.wait_until(predicate, seconds), f"not within {seconds} s: {what}"


@attrs.frozen
class Papers:
    """A certificate authority's files in a folder."""

    folder: Path
    ca: str = "ca"

    def of(self, name: str, *, ca: str | None = None) -> TlsOptions:
        return TlsOptions(
            ca=str(self.folder / f"{ca or self.ca}.pem"),
            certificate=str(self.folder / f"{name}.pem"),
            key=str(self.folder / f"{name}.key"),
        )

    def make_ca(self) -> None:
        self._openssl(
            "req", "-x509", *NEW_KEY, "-nodes", "-days", "2", "-subj", f"/CN={self.ca}",
            "-keyout", f"{self.ca}.key", "-out", f"{self.ca}.pem",
        )  # fmt: skip

    def make(self, name: str, common_name: str) -> None:
        self._openssl(
            "req", *NEW_KEY, "-nodes", "-subj", f"/CN={common_name}",
            "-keyout", f"{name}.key", "-out", f"{name}.csr",
        )  # fmt: skip
        (self.folder / "names").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1")
        self._openssl(
            "x509", "-req", "-in", f"{name}.csr", "-CA", f"{self.ca}.pem",
            "-CAkey", f"{self.ca}.key", "-CAcreateserial", "-days", "2", "-extfile", "names",
            "-out", f"{name}.pem",
        )  # fmt: skip

    def _openssl(self, *arguments: str) -> None:
        assert OPENSSL is not None
        subprocess.run([OPENSSL, *arguments], cwd=self.folder, check=True, capture_output=True)


NEW_KEY = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1")


@pytest.fixture(scope="module")
def papers(tmp_path_factory: pytest.TempPathFactory) -> Papers:
    if OPENSSL is None:
        pytest.skip("needs the openssl command to make certificates")
    made = Papers(tmp_path_factory.mktemp("papers"))
    subprocess.run(["sh", "-ec", block("sh", "openssl")], cwd=made.folder, check=True)  # noqa: S607
    made.make("robot-2", "robot-2")
    forger = Papers(made.folder, ca="other-ca")
    forger.make_ca()
    forger.make("forged-robot-1", "robot-1")
    return made


@pytest.fixture
def gateway(papers: Papers) -> Iterator[Gateway]:
    """Takes robots with a certificate of our authority, and lets each speak for itself."""
    options = ZenohOptions(
        listen=(free_endpoint().replace("tcp/", "tls/"),),
        tls=papers.of("gateway"),
        config=access_for(
            {robot: {"cert_common_names": [robot]} for robot in ("robot-1", "robot-2")}
        ),
    )
    made = Gateway(options)
    yield made
    made.source.close()


def test_the_recipe_of_the_page_is_the_one_tried_here() -> None:
    (source,) = yaml.safe_load(block("yaml", "access_control"))["sources"].values()
    assert source["adapter"] == "zenoh"
    options = source["options"]
    assert options["config"] == access_for({"robot-1": {"cert_common_names": ["robot-1"]}})
    robot = yaml.safe_load(block("yaml", "robot-1.pem"))
    for said in (options, robot):
        TlsOptions(**said.pop("tls"))
        ZenohOptions(**said)


def robot_options(gateway: Gateway, tls: TlsOptions | None) -> ZenohOptions:
    return ZenohOptions(mode="client", connect=gateway.options.listen, tls=tls)


def test_a_robot_with_its_certificate_comes_crashes_and_leaves_as_without(
    gateway: Gateway, papers: Papers
) -> None:
    first = ProcessAnnouncer(robot_options(gateway, papers.of("robot-1")), AN_HOUR_S)
    second = ProcessAnnouncer(robot_options(gateway, papers.of("robot-2")), AN_HOUR_S)
    first.announce(BeaconHint("robot-1"))
    second.announce(BeaconHint("robot-2"))
    gateway.becomes("robot-1", Status.ACTIVE, 30.0)  # their processes are up
    gateway.becomes("robot-2", Status.ACTIVE, 30.0)
    first.end(signal.SIGKILL)
    second.end(signal.SIGINT)
    gateway.becomes("robot-1", Status.STALE, 1.0)
    gateway.becomes("robot-2", Status.LEFT, 1.0)


def test_a_gateway_that_comes_back_may_ask_the_robots(gateway: Gateway, papers: Papers) -> None:
    robot = ZenohAnnouncer(robot_options(gateway, papers.of("robot-1")), AN_HOUR_S)
    robot.announce(BeaconHint("robot-1"))
    gateway.becomes("robot-1", Status.ACTIVE)
    gateway.restart()
    gateway.becomes("robot-1", Status.ACTIVE, 2.0)
    robot.close()


def test_a_robot_can_speak_for_nobody_else(gateway: Gateway, papers: Papers) -> None:
    victim = ZenohAnnouncer(robot_options(gateway, papers.of("robot-2")), AN_HOUR_S)
    victim.announce(BeaconHint("robot-2", display_name="true"))
    gateway.becomes("robot-2", Status.ACTIVE)
    evil_options = robot_options(gateway, papers.of("robot-1"))
    evil = zenoh.open(session_config(evil_options, "client").make())
    false = json.encode(BeaconHint("robot-2", display_name="false"))
    evil.put("beacon/hint/robot-2", false)
    evil.delete("beacon/hint/robot-2")
    evil.put("beacon/hint/*", false)
    evil.liveliness().declare_token("beacon/live/robot-2/another-run")
    evil.declare_queryable("beacon/hint/*", lambda query: query.reply("beacon/hint/robot-2", false))
    # What it may: its own key. But the payload is about another.
    evil.put("beacon/hint/robot-1", false)
    gateway.within(
        lambda: gateway.intake.totals()[Verdict.INVALID] == 1, "the false payload is refused"
    )
    gateway.says_the_truth_about("robot-2")
    assert gateway.source.health().counters["tokens"] == 1
    assert [report.name for report in gateway.intake.sources()] == ["robot-2", "robot-1"]
    # Once more, with everybody being asked.
    gateway.restart()
    gateway.becomes("robot-2", Status.ACTIVE)
    gateway.within(lambda: gateway.source.health().counters["links"] == 2, "both are back")

    def refused() -> bool:
        # Its own end may not know of the link yet.
        evil.put("beacon/hint/robot-1", false)
        return gateway.intake.totals()[Verdict.INVALID] >= 1

    gateway.within(refused, "the false payload is refused")
    gateway.says_the_truth_about("robot-2")
    evil.close()
    victim.close()


@pytest.mark.parametrize(
    "papers_of",
    [
        pytest.param(lambda _: None, id="no papers"),
        pytest.param(
            lambda papers: attrs.evolve(papers.of("robot-1"), certificate="", key=""),
            id="no certificate",
        ),
        pytest.param(lambda papers: papers.of("forged-robot-1"), id="forged"),
        pytest.param(lambda papers: papers.of("robot-1", ca="other-ca"), id="wrong gateway"),
    ],
)
def test_who_cannot_prove_itself_or_doubts_the_gateway_is_not_connected_and_told_where_to_look(
    gateway: Gateway, papers: Papers, papers_of: Callable[[Papers], TlsOptions | None]
) -> None:
    robot = ZenohAnnouncer(robot_options(gateway, papers_of(papers)), AN_HOUR_S)
    robot.announce(BeaconHint("robot-1"))
    assert not gateway.wait_until(lambda: gateway.status("robot-1") is not None, 0.5)
    health = robot.health()
    assert health.condition is Condition.STARTING
    assert "check the certificates" in health.detail
    robot.close()


def test_passwords_open_the_door_and_bind_a_robot_to_its_key(tmp_path: Path) -> None:
    users = tmp_path / "users.txt"
    users.write_text("robot-1:secret-1\nrobot-2:secret-2\n")
    gateway = Gateway(
        ZenohOptions(
            listen=(free_endpoint(),),
            users_file=str(users),
            config=access_for({"robot-1": {"usernames": ["robot-1"]}}),
        )
    )

    def robot(user: str, password: str) -> ZenohAnnouncer:
        connect = gateway.options.listen
        options = ZenohOptions(mode="client", connect=connect, user=user, password=password)
        return ZenohAnnouncer(options, AN_HOUR_S)

    right, wrong, none = robot("robot-1", "secret-1"), robot("robot-1", "guess"), robot("", "")
    other = robot("robot-2", "secret-2")
    for one in (wrong, none, other):
        one.announce(BeaconHint("robot-1", display_name="false"))
    right.announce(BeaconHint("robot-1", display_name="true"))
    gateway.becomes("robot-1", Status.ACTIVE)
    other.announce(BeaconHint("robot-1", display_name="false again"))
    right.announce(BeaconHint("robot-1", display_name="true", stable_id="last"))
    gateway.within(lambda: gateway.hint("robot-1").stable_id == "last", "the last word is heard")
    gateway.says_the_truth_about("robot-1")
    assert [report.name for report in gateway.intake.sources()] == ["robot-1"]
    assert wrong.health().condition is Condition.STARTING
    assert "check user and password" in wrong.health().detail
    assert none.health().condition is Condition.STARTING
    for one in (right, wrong, none, other):
        one.close()
    gateway.source.close()
