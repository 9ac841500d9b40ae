"""One context per domain, as long as anybody needs it."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed: there are no contexts to share")

from beacon_core.errors import ConfigError, UsageError
from beacon_ros.domains import DomainLease
from beacon_ros.participant import NO_FORK, OwnNode

LeavesNothing = Callable[..., None]


def test_many_nodes_have_one_participant(
    domain: int, threads: Callable[[], int], eventually: Callable[..., None]
) -> None:
    first = OwnNode("first", domain)
    with_one = threads()
    others = [OwnNode(f"other_{number}", domain) for number in range(10)]
    # Of those with which it began, some may have been an earlier test's.
    eventually(lambda: threads() <= with_one)
    assert {other.context for other in others} == {first.context}
    for node in (first, *others):
        node.close()


def test_domains_have_one_each(domain: int) -> None:
    with DomainLease() as lease:
        here, there = OwnNode("here", domain), OwnNode("there", lease.domain_id)
        assert here.context is not there.context
        assert here.context.get_domain_id() == domain
        here.close()
        there.close()


def test_without_a_number_it_is_the_domain_of_the_environment(
    domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    own = OwnNode("here", None)
    assert own.context.get_domain_id() == domain
    own.close()


def test_the_last_one_takes_the_context_with_it(domain: int, leaves_nothing: LeavesNothing) -> None:
    def come_and_go() -> None:
        first, second = OwnNode("first", domain), OwnNode("second", domain)
        first.close()
        first.close()
        assert second.context.ok()
        second.close()
        second.close()

    leaves_nothing(come_and_go)


def test_nodes_that_are_closed_at_once_by_many_threads_leave_nothing(
    domain: int, leaves_nothing: LeavesNothing
) -> None:
    def come_and_go() -> None:
        nodes = [OwnNode(f"one_of_{number}", domain) for number in range(5)]
        closers = [threading.Thread(target=node.close) for node in nodes]
        for closer in closers:
            closer.start()
        for closer in closers:
            closer.join()

    leaves_nothing(come_and_go, times=20)


def test_a_context_that_was_shut_down_is_replaced(domain: int) -> None:
    first = OwnNode("first", domain)
    first.context.shutdown()
    second = OwnNode("second", domain)
    assert second.context.ok()
    first.close()
    assert second.context.ok()
    third = OwnNode("third", domain)
    assert third.context is second.context
    second.close()
    third.close()


def test_a_node_that_cannot_be_made_leaves_no_context(
    domain: int, leaves_nothing: LeavesNothing
) -> None:
    def fail() -> None:
        with pytest.raises(ConfigError, match="ROS refuses to begin: Invalid node name"):
            OwnNode("no name", domain)

    leaves_nothing(fail, 5)


def test_its_nodes_are_hidden_and_differ(domain: int) -> None:
    nodes = [OwnNode("role", domain) for _ in range(2)]
    names = [own.node.get_name() for own in nodes]
    assert all(name.startswith("_beacon_role_") for name in names)
    assert names[0] != names[1]
    for own in nodes:
        own.close()


@pytest.mark.parametrize("services", [False, True])
def test_it_answers_for_parameters_only_if_it_shall(domain: int, *, services: bool) -> None:
    own = OwnNode("role", domain, parameter_services=services)
    names = [name for name, _ in own.node.get_service_names_and_types()]
    assert any(name.endswith("/list_parameters") for name in names) == services
    own.close()


@pytest.mark.parametrize("domain_id", [233, 5000])
def test_a_domain_that_there_cannot_be_is_refused_before_it_ends_the_process(
    domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = f"{domain_id} is no domain; write 0 to 232"
    with pytest.raises(ConfigError, match=f"^domain_id: {said}$"):
        OwnNode("role", domain_id)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    with pytest.raises(ConfigError, match=f"^ROS_DOMAIN_ID: {said}$"):
        OwnNode("role", None)


def test_what_is_no_number_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "five")
    with pytest.raises(ConfigError, match=r"^ROS refuses to begin: .*ROS_DOMAIN_ID.*number"):
        OwnNode("role", None)


def test_keys_that_are_none_are_told_in_one_line(
    domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    enclave = tmp_path / "enclaves" / "gateway"
    enclave.mkdir(parents=True)
    for name in ("identity_ca.cert.pem", "cert.pem", "key.pem"):
        (enclave / name).touch()
    for name in ("permissions_ca.cert.pem", "governance.p7s", "permissions.p7s"):
        (enclave / name).touch()
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(tmp_path))
    monkeypatch.setenv("ROS_SECURITY_ENCLAVE_OVERRIDE", "/gateway")
    with pytest.raises(ConfigError, match=r"^ROS refuses to begin: [^\n]*$"):
        OwnNode("role", domain)


def test_a_forked_child_is_told_that_nobody_would_hear_it(
    run_script: Callable[[str], subprocess.CompletedProcess[str]],
) -> None:
    ended = run_script(
        "import os\n"
        "from beacon_ros.participant import OwnNode\n"
        "from beacon_core.errors import UsageError\n"
        "def child():\n"
        "    try: OwnNode('child', None).close(); print('made', flush=True)\n"
        "    except UsageError as error: print(error, flush=True)\n"
        "    os._exit(0)\n"
        "for _ in range(2):\n"
        "    pid = os.fork() or child()\n"
        "    assert os.waitpid(pid, 0)[1] == 0\n"
        "    OwnNode('parent', None).close()\n"
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.splitlines() == ["made", NO_FORK]
    assert issubclass(UsageError, Exception)
