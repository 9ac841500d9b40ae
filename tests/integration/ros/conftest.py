"""Real ROS processes, each test in a domain of its own; and the message's package, built once."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import attrs
import httpx
import pytest

from beacon_ros.domains import DomainLease

INTERFACES = Path(__file__).parents[3] / "adapters" / "ros_topic" / "interfaces"
NODES = Path(__file__).with_name("nodes")

DEADLINE_S = 30.0
"""Discovery takes 0.1 s or 1.5 to 3 s, and on a busy machine a process takes seconds to start."""

_PATIENCE_S = 5.0
"""For processes that are no longer needed."""

_SHOWN = 8000
"""Of what a process said, so many characters from the end."""

_NEEDED = (
    "ros-diagnostic-msgs~=5.3.6",
    "ros-std-msgs~=5.3.6",
    "ros-geometry-msgs~=5.3.6",
    "ros-sensor-msgs~=5.3.6",
)
_BUILT = "\nbuilt\n"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Whoever comes first builds the package, and the others wait for it."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.system)
        if "typed" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.timeout(400))


@attrs.frozen
class Child:
    """A process started for a test, in a process group of its own."""

    command: tuple[str, ...]
    process: subprocess.Popen[bytes]
    out: Path
    err: Path

    @property
    def pid(self) -> int:
        return self.process.pid

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def said(self) -> list[dict[str, Any]]:
        """The lines of JSON that it has written to stdout so far.

        Fast DDS writes there too: processes that start together contend for its shared memory.
        """
        whole, _, _ = self.out.read_text("utf-8", "replace").rpartition("\n")
        return [json.loads(line) for line in whole.splitlines() if line.startswith("{")]

    def ends(self, within_s: float = DEADLINE_S) -> int:
        """Wait for its end; returns the exit code."""
        return self.process.wait(within_s)


@attrs.frozen
class Children:
    """Starts processes; what they said is shown with the test that failed."""

    folder: Path
    started: list[Child] = attrs.field(factory=list)

    def start(self, *command: str | Path, env: Mapping[str, str] | None = None) -> Child:
        """A process with ``env`` on top of this one's."""
        number = len(self.started)
        out, err = (self.folder / f"child-{number}.{kind}" for kind in ("out", "err"))
        with out.open("wb") as to, err.open("wb") as errors:
            words = tuple(map(str, command))
            process = subprocess.Popen(
                words,
                stdout=to,
                stderr=errors,
                start_new_session=True,
                env={
                    **os.environ,
                    "PYTHONUNBUFFERED": "1",
                    "ROS_LOG_DIR": str(self.folder / "ros"),
                    **(env or {}),
                },
            )
        child = Child(words, process, out, err)
        self.started.append(child)
        return child

    def node(self, script: str, *arguments: str, env: Mapping[str, str] | None = None) -> Child:
        """One of the scripts in ``nodes``."""
        return self.start(sys.executable, NODES / f"{script}.py", *arguments, env=env)

    def beacon(self, *arguments: str | Path, env: Mapping[str, str] | None = None) -> Child:
        """The ``beacon`` command."""
        return self.start(sys.executable, "-m", "beacon_gateway", *arguments, env=env)

    def end_all(self) -> None:
        """Ask them to end, also those that are stopped; who was killed leaves files behind."""
        running = [child for child in self.started if child.process.poll() is None]
        for child in running:
            child.signal(signal.SIGTERM)
            child.signal(signal.SIGCONT)
        deadline = time.monotonic() + _PATIENCE_S
        for child in running:
            with suppress(subprocess.TimeoutExpired):
                child.process.wait(max(0.0, deadline - time.monotonic()))
        for child in self.started:
            with suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
            code = child.process.wait()
            print(f"--- {' '.join(child.command)} ended with {code}")  # noqa: T201 - pytest shows it
            for said in (child.out, child.err):
                print(said.read_text("utf-8", "replace")[-_SHOWN:])  # noqa: T201 - the same


@attrs.frozen
class Gateway:
    """A running ``beacon run``, asked over HTTP."""

    url: str
    child: Child

    def get(self, path: str) -> tuple[int, dict[str, Any]]:
        response = httpx.get(f"{self.url}/api/v1/{path}", timeout=10)
        return response.status_code, response.json()

    def status(self, path: str) -> str:
        """As that endpoint tells it: active, stale, left; or an error code."""
        return _status(*self.get(path))

    def becomes(self, path: str, status: str, within_s: float = DEADLINE_S) -> dict[str, Any]:
        """Wait until that endpoint tells this status; returns what it told then."""
        told: dict[str, Any] = {}

        def is_so() -> bool:
            code, body = self.get(path)
            told.clear()
            told.update(body)
            return _status(code, body) == status

        wait_until(is_so, f"{path} {status}", within_s)
        return told


def wait_until(
    true: Callable[[], object], what: str = "it is true", within_s: float = DEADLINE_S
) -> None:
    """Ask again and again, at most for ``within_s``."""
    deadline = time.monotonic() + within_s
    while not true():
        assert time.monotonic() < deadline, f"not within {within_s} s: {what}"
        time.sleep(0.02)


@pytest.fixture(name="wait_until")
def wait_until_fixture() -> Callable[..., None]:
    return wait_until


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain for this test alone, in its environment and that of its children."""
    with DomainLease() as lease:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(lease.domain_id))
        yield lease.domain_id


@pytest.fixture
def children(tmp_path: Path, domain: int) -> Iterator[Children]:
    """Its processes have ended with the test, whatever state they were in."""
    made = Children(tmp_path)
    yield made
    made.end_all()


@pytest.fixture
def gateway(children: Children, tmp_path: Path) -> Callable[..., Gateway]:
    """Starts ``beacon run`` with what is given of a configuration, on a port of its own."""

    def start(text: str, env: Mapping[str, str] | None = None) -> Gateway:
        config = tmp_path / f"gateway-{len(children.started)}.yaml"
        config.write_text(f"http: {{port: 0}}\n{text}", "utf-8")
        child = children.beacon("run", "-c", config, "--json", env=env)
        wait_until(lambda: child.said() or child.process.poll() is not None, "the gateway serves")
        assert child.said(), child.err.read_text("utf-8")
        return Gateway(child.said()[0]["url"], child)

    return start


@pytest.fixture(scope="session")
def typed(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """What a child's environment needs in order to import ``ros2_medkit_msgs``.

    The package is built once per run of pytest, whatever the number of its workers, as ``pip
    install`` builds it. It goes into a folder of its own: here, and in gateways, it stays unknown.
    """
    if shutil.which("g++") is None:
        pytest.skip("ros2_medkit_msgs cannot be built: there is no g++")
    # The workers' folders lie in one that belongs to this run.
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own
    prefix, log = shared / "ros2_medkit_msgs", shared / "ros2_medkit_msgs.log"
    with _locked(shared / "ros2_medkit_msgs.lock"):
        if not log.exists():
            _build(prefix, log)
    assert log.read_text("utf-8").endswith(_BUILT), log.read_text("utf-8")[-_SHOWN:]
    packages = sysconfig.get_path("platlib", vars={"base": str(prefix), "platbase": str(prefix)})
    return {
        "PYTHONPATH": _before("PYTHONPATH", packages),
        # The ros-* wheels set it for this process, and would not do so anew for a child.
        "LD_LIBRARY_PATH": _before("LD_LIBRARY_PATH", str(prefix / "lib")),
    }


def _status(code: int, body: Mapping[str, Any]) -> str:
    if code == httpx.codes.OK:
        return str(body["status"])
    return str(body.get("parameters", {}).get("status", body["error_code"]))


def _build(prefix: Path, log: Path) -> None:
    """What the message needs is named: everything else is here already, since rclpy needs it."""
    install = (sys.executable, "-m", "pip", "install", "--no-deps", "--ignore-installed")
    with log.open("wb") as said:
        code = subprocess.call(
            (*install, "--prefix", prefix, INTERFACES, *_NEEDED), stdout=said, stderr=said
        )
        if code == 0:
            said.write(_BUILT.encode())


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    with path.open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _before(variable: str, path: str) -> str:
    return os.pathsep.join(filter(None, (path, os.environ.get(variable))))
