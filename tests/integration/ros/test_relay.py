"""Two ROS networks, and relays between them over Zenoh, each part a process of its own.

The relays' processes cannot import the types of what they carry: ``sensor_msgs`` and
``ros2_medkit_msgs`` are known to the robot and to who listens, to nobody else.
"""

from __future__ import annotations

import os
import random
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import httpx
import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no ROS networks")
pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed: there is no conduit")

from beacon_gateway.server import free_port
from beacon_ros.domains import DomainLease

if TYPE_CHECKING:
    from tests.integration.ros.conftest import Child, Children

WaitUntil = Callable[..., None]

DOCUMENT = Path(__file__).parents[3] / "docs" / "relay.md"

END = """
ends:
  {name}:
    network: {{adapter: ros, options: {{domain_id: {domain}}}}}
    conduit: {{adapter: zenoh, options: {{{zenoh}}}}}
    {does}
http: {{port: {port}}}
state_folder: {folder}
"""

RULES = "forward: [{deny: /rosout}, {deny: /parameter_events}, {allow: /**, to: /robot/**}]"


@attrs.frozen
class End:
    """A running ``beacon relay``, asked over HTTP."""

    url: str
    child: Child

    def told(self) -> dict[str, Any]:
        (end,) = httpx.get(f"{self.url}/api/v1/x-beacon-relay", timeout=10).json()["ends"]
        return dict(end)


@attrs.frozen
class Tour:
    """A robot's network, a site's, and whatever is started between them."""

    children: Children
    folder: Path
    robot_domain: int
    site_domain: int
    typed: Mapping[str, str]
    wait_until: WaitUntil

    def end(self, name: str, zenoh: str, does: str = RULES) -> End:
        """``robot`` or ``site``; returns once it serves."""
        domain = self.robot_domain if name == "robot" else self.site_domain
        config = self.folder / f"{name}.yaml"
        config.write_text(
            END.format(name=name, domain=domain, zenoh=zenoh, does=does, port=0, folder=self.folder)
        )
        child = self.children.beacon("relay", "-c", config, "--json")
        self.wait_until(lambda: child.said() or child.process.poll() is not None, "it serves")
        assert child.said(), child.err.read_text("utf-8")
        return End(child.said()[0]["url"], child)

    def robot(self, script: str, *parameters: str) -> Child:
        words = [word for one in parameters for word in ("-p", one)]
        arguments = ("--ros-args", *words) if words else ()
        return self._node(script, self.robot_domain, *arguments)

    def listener(self, script: str = "relay_hearer") -> Child:
        child = self._node(script, self.site_domain)
        self.wait_until(child.said, "it listens")
        return child

    def _node(self, script: str, domain: int, *arguments: str) -> Child:
        env = {**self.typed, "ROS_DOMAIN_ID": str(domain)}
        return self.children.node(script, *arguments, env=env)


@pytest.fixture
def tour(
    children: Children,
    domain: int,
    tmp_path: Path,
    typed: Mapping[str, str],
    wait_until: WaitUntil,
) -> Iterator[Tour]:
    with DomainLease() as site:
        yield Tour(children, tmp_path, domain, site.domain_id, typed, wait_until)


def heard(child: Child, what: str) -> list[Any]:
    return [one[what] for one in child.said() if what in one]


def balanced(books: Mapping[str, Any]) -> bool:
    return bool(
        books["messages"] == books["held"] + books.get("missing", 0) + sum(books["ended"].values())
    )


def test_text_images_a_late_joiners_map_and_a_type_nobody_between_knows_arrive_intact(
    tour: Tour,
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    site = tour.end("site", f"listen: [{endpoint}]", "republish: true")
    robot = tour.end("robot", f"connect: [{endpoint}]")
    tour.robot("relay_talker")
    tour.robot("temp_sensor")
    tour.wait_until(lambda: len(site.told()["republish"]["topics"]) == 4, "all are published")
    # It comes late: the map was said once, before it was there.
    early, late = tour.listener(), None
    tour.wait_until(lambda: heard(early, "map") == ["the map of life 1"], "the map")
    tour.wait_until(lambda: len(heard(early, "image")) >= 5, "images")
    tour.wait_until(lambda: len(heard(early, "text")) >= 50, "texts")
    late = tour.listener()
    tour.wait_until(lambda: heard(late, "map") == ["the map of life 1"], "the map, late")
    images = [one for one in early.said() if "image" in one]
    assert all(one["intact"] for one in images)
    numbers = [one["image"] for one in images]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    texts = [number for _, number in heard(early, "text")]
    assert texts == list(range(texts[0], texts[0] + len(texts)))
    types = {one["name"]: one["type"] for one in site.told()["republish"]["topics"]}
    assert types["/robot/camera/image"] == "sensor_msgs/msg/Image"
    assert types["/robot/ros2_medkit/discovery"] == "ros2_medkit_msgs/msg/MedkitDiscoveryHint"
    assert balanced(robot.told()["forward"])
    assert balanced(site.told()["republish"])
    assert set(site.told()["republish"]["ended"]) == {"delivered"}


def test_a_hint_of_a_type_that_is_installed_nowhere_between_is_understood_at_the_far_end(
    tour: Tour,
) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    does = "forward: [{allow: /ros2_medkit/discovery}]"
    site = tour.end("site", f"listen: [{endpoint}]", "republish: true")
    tour.end("robot", f"connect: [{endpoint}]", does)
    tour.robot("temp_sensor")
    listener = tour.listener("hint_listener")
    tour.wait_until(lambda: heard(listener, "entity_id"), "a hint")
    (hint, *_) = [one for one in listener.said() if "entity_id" in one]
    assert hint["display_name"] == "Temperature, engine (°C)"
    assert hint["metadata"] == {"firmware": "1.2.3", "vendor": "acme"}
    (topic,) = site.told()["republish"]["topics"]
    assert topic["type_hash"].startswith("RIHS01_")


def test_the_tutorial_of_the_documentation_works_as_written(
    tour: Tour, gateway: Callable[..., Any]
) -> None:
    robot, base = re.findall(r"^```yaml\n(.*?)^```", DOCUMENT.read_text(), re.DOTALL | re.MULTILINE)
    port = str(free_port())
    own = {
        "domain_id: 7": f"domain_id: {tour.robot_domain}",
        "domain_id: 8": f"domain_id: {tour.site_domain}",
        "7448": port,
        "http: {port: 8080}\n": "",
    }
    assert all(shown in robot + base for shown in own)
    # All at once: a domain that is put in may begin with the digit of one that is shown.
    any_shown = re.compile("|".join(map(re.escape, own)))
    robot, base = (any_shown.sub(lambda one: own[one.group()], text) for text in (robot, base))
    kept = f"state_folder: {tour.folder}\n"
    at_base = gateway(base.replace("relay:\n", f"relay:\n  {kept}"))
    config = tour.folder / "robot.yaml"
    config.write_text(f"{robot}{kept}http: {{port: 0}}\n")
    on_robot = tour.children.beacon("relay", "-c", config, "--json")
    tour.robot("temp_sensor")
    at_base.becomes("apps/temp_sensor/x-medkit-beacon", "active")
    told = httpx.get(f"{at_base.url}/api/v1/x-beacon-relay", timeout=10).json()
    (topic,) = told["ends"][0]["republish"]["topics"]
    assert (topic["name"], topic["state"]) == ("/ros2_medkit/discovery", "live")
    (url,) = (one["url"] for one in on_robot.said())
    explained = tour.children.beacon("relay", "explain", "/ros2_medkit/discovery", "--url", url)
    assert explained.ends() == 0
    assert "allowed by rule 0" in explained.out.read_text()


class Chaos:
    """Kills and starts again what a tour is made of, and remembers what must be true of it."""

    def __init__(self, tour: Tour, draw: random.Random) -> None:
        self.tour, self.draw = tour, draw
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.life = 0
        self.parts: dict[str, Any] = {}
        self.starters = {
            "router": self.start_router,
            "site": lambda: self.start_end("site", "republish: {gap_s: 1}"),
            "robot": lambda: self.start_end("robot", RULES),
            "talker": self.start_talker,
        }
        for name in self.starters:
            self.start(name)
        self.listener = tour.listener()

    def start(self, name: str) -> None:
        self.parts[name] = self.starters[name]()

    def start_router(self) -> Child:
        script = Path(__file__).parent / "nodes" / "zenoh_router.py"
        child = self.tour.children.start(sys.executable, script, self.endpoint)
        self.tour.wait_until(child.said, "the router is up")
        return child

    def start_end(self, name: str, does: str) -> End:
        return self.tour.end(name, f"mode: client, connect: [{self.endpoint}]", does)

    def start_talker(self) -> Child:
        self.life += 1
        return self.tour.robot(
            "relay_talker", f"life:={self.life}", "period_s:=0.02", "images:=false"
        )

    def strike(self) -> None:
        name = self.draw.choice(list(self.starters))
        part = self.parts[name]
        child = part.child if isinstance(part, End) else part
        child.signal(signal.SIGKILL)
        child.ends()
        if self.draw.random() < 0.5:
            time.sleep(self.draw.uniform(0, 2))  # it is missing for a while
        self.start(name)

    def check(self) -> None:
        """In order and without repeats, whatever was killed; and the books balance."""
        texts = heard(self.listener, "text")
        assert texts == sorted(texts)
        assert len({tuple(one) for one in texts}) == len(texts)
        forward = self.parts["robot"].told()["forward"]
        republish = self.parts["site"].told()["republish"]
        assert balanced(forward), forward
        assert balanced(republish), republish


def chaos(tour: Tour, seconds: float) -> None:
    seed = int(os.environ.get("BEACON_CHAOS_SEED", str(time.time_ns() % 10**6)))
    print(f"BEACON_CHAOS_SEED={seed}")  # noqa: T201 - to have the same again
    it = Chaos(tour, random.Random(seed))  # noqa: S311
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        it.strike()
        time.sleep(it.draw.uniform(0, 3))  # the pace of the strikes, not a wait for something
    it.parts["talker"].signal(signal.SIGKILL)
    it.start("talker")

    def well_again() -> bool:
        # Not the 100th itself: it may have been said before the relay had found the talker.
        return any(life == it.life and said >= 100 for life, said in heard(it.listener, "text"))

    tour.wait_until(well_again, "all is well again", 60)
    it.parts["talker"].signal(signal.SIGTERM)
    it.parts["talker"].ends()
    tour.wait_until(
        lambda: it.parts["site"].told()["republish"]["missing"] == 0, "nothing is missing"
    )
    it.check()
    said = [tuple(one) for one in heard(it.listener, "text")]
    print(f"{len(said)} texts heard of {it.life} lives")  # noqa: T201 - the soak's report
    ended = it.parts["site"].told()["republish"]["ended"]
    print(ended, it.parts["robot"].told()["forward"]["ended"])  # noqa: T201 - the same


@pytest.mark.timeout(180)
def test_whatever_is_killed_the_rest_goes_on_in_order_and_without_repeats(tour: Tour) -> None:
    chaos(tour, 15.0)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_whatever_is_killed_for_five_minutes(tour: Tour) -> None:
    chaos(tour, float(os.environ.get("CHAOS_S", "300")))
