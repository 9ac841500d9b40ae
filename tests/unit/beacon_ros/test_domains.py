"""No two takers get one domain, and who has ended holds none."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from beacon_ros import domains
from beacon_ros.domains import DomainLease


@pytest.fixture(autouse=True)
def _few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three domains that no real taker uses."""
    begin = 1_000 + os.getpid() * 10
    monkeypatch.setattr(domains, "DOMAINS", range(begin, begin + 3))


def test_each_taker_gets_a_domain_of_its_own_until_there_are_no_more() -> None:
    leases = [DomainLease() for _ in range(3)]
    assert {lease.domain_id for lease in leases} == set(domains.DOMAINS)
    with pytest.raises(RuntimeError, match="in use"):
        DomainLease()
    for lease in leases:
        lease.close()


def test_a_domain_given_back_is_free_again() -> None:
    with DomainLease(), DomainLease(), DomainLease() as last:
        last.close()
        last.close()
        with DomainLease() as again:
            assert again.domain_id == last.domain_id


def test_a_process_that_is_killed_holds_nothing() -> None:
    code = (
        "import os; from beacon_ros import domains\n"
        f"domains.DOMAINS = range({domains.DOMAINS[0]}, {domains.DOMAINS[0] + 3})\n"
        "kept = [domains.DomainLease() for _ in range(3)]\n"
        "print(flush=True); input()"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        with pytest.raises(RuntimeError, match="in use"):
            DomainLease()
        holder.kill()
        holder.wait()
        DomainLease().close()


def test_who_leases_a_domain_stays_on_this_machine_and_shares_no_memory() -> None:
    program = (
        "import os, pathlib\n"
        "from beacon_ros.domains import DomainLease\n"
        "from beacon_ros.participant import OwnNode\n"
        "with DomainLease() as lease:\n"
        "    own = OwnNode('domains', lease.domain_id)\n"
        "    print(pathlib.Path('/proc/self/maps').read_text())\n"
        "    print(pathlib.Path(os.environ['FASTRTPS_DEFAULT_PROFILES_FILE']).read_text())\n"
        "    own.close()\n"
    )
    said = subprocess.check_output([sys.executable, "-c", program], text=True)
    assert "<address>127.0.0.1</address>" in said
    assert "libfastrtps" in said
    assert "/fastrtps_port" not in said
