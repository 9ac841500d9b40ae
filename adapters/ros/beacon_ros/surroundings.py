"""What the environment makes of ROS here: which one it is, its domain, and how far it looks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from beacon_core.ports.examination import Finding, Level
from beacon_ros.environment import distribution

__all__ = ["domain", "domain_ports", "in_container", "range_findings", "which_ros"]

_DEFAULT_DOMAIN = 0

_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"

_RANGES: Mapping[str, Finding] = {
    "SUBNET": Finding(Level.OK, f"{_RANGE} is SUBNET: this machine and its subnet are seen"),
    "SYSTEM_DEFAULT": Finding(Level.OK, f"{_RANGE} is SYSTEM_DEFAULT: left to the middleware"),
    "LOCALHOST": Finding(
        Level.NOTE,
        f"{_RANGE} is LOCALHOST: no other machine is seen",
        "for other machines set it to SUBNET, here and there",
    ),
    "OFF": Finding(
        Level.PROBLEM,
        f"{_RANGE} is OFF: nobody is discovered",
        "set it to LOCALHOST or SUBNET, or unset it",
    ),
}

_MEANINGS: Mapping[str, str] = {
    "ROS_STATIC_PEERS": "these machines are asked besides",
    "ROS_DISCOVERY_SERVER": "who does not use the same discovery server is not seen",
    "FASTDDS_BUILTIN_TRANSPORTS": "who has none of these transports is not heard; "
    "SHM alone reaches this machine only",
    "FASTRTPS_DEFAULT_PROFILES_FILE": "it may restrict interfaces, peers and transports",
    "FASTDDS_DEFAULT_PROFILES_FILE": "it may restrict interfaces, peers and transports",
    "CYCLONEDDS_URI": "it may restrict interfaces and peers",
    "ZENOH_SESSION_CONFIG_URI": "it says where rmw_zenoh finds its router",
    "ROS_SECURITY_ENABLE": "with SROS2, who has no enclave is not heard",
}
"""What changes who is seen, and cannot be judged from here."""

_MARKS_OF_CONTAINERS = ("/.dockerenv", "/run/.containerenv")


def which_ros(rmw: str) -> Finding:
    """The installation; ``rmw`` is the middleware's name."""
    try:
        rclpy = f"rclpy {version('rclpy')}"
    except PackageNotFoundError:
        rclpy = "rclpy of an unknown version"
    distro = distribution() or "(which one cannot be told)"
    return Finding(Level.OK, f"ROS 2 {distro}, {rclpy}, {rmw}")


def domain(configured: int | None, actual: int, environ: Mapping[str, str]) -> Finding:
    """The domain, and who says so."""
    named = environ.get("ROS_DOMAIN_ID", "")
    if configured is None:
        where = f"ROS_DOMAIN_ID={named}" if named else "the default: ROS_DOMAIN_ID is not set"
        return Finding(Level.OK, f"domain {actual} ({where})")
    what = f"domain {actual} (domain_id in the configuration)"
    if (named or str(_DEFAULT_DOMAIN)) == str(configured):
        return Finding(Level.OK, what)
    shell = f"ROS_DOMAIN_ID={named}" if named else "ROS_DOMAIN_ID is not set"
    return Finding(Level.OK, f"{what}; this shell's own is another ({shell})")


def range_findings(environ: Mapping[str, str]) -> Iterator[Finding]:
    """How far discovery looks, and whatever else in the environment changes who is seen."""
    if environ.get("ROS_LOCALHOST_ONLY") == "1":
        yield Finding(
            Level.NOTE,
            "ROS_LOCALHOST_ONLY is 1: no other machine is seen",
            f"for other machines unset it, here and there ({_RANGE} has taken its place)",
        )
    else:
        yield _range(environ.get(_RANGE, ""))
    for name, meaning in _MEANINGS.items():
        value = environ.get(name, "")
        if not value or (name == "ROS_SECURITY_ENABLE" and value.lower() != "true"):
            continue
        yield Finding(Level.NOTE, f"{name} is {value}", meaning)
        if name.endswith("_PROFILES_FILE") and not Path(value).is_file():
            yield Finding(Level.PROBLEM, f"{value} is not there", f"correct {name}, or unset it")


def domain_ports(domain_id: int) -> str:
    """The UDP ports that DDS uses for a domain, as a firewall would have them."""
    first = 7400 + 250 * domain_id
    return f"{first}-{first + 249}"


def in_container() -> bool:
    """Is this a docker or podman container?"""
    return any(Path(mark).exists() for mark in _MARKS_OF_CONTAINERS)


def _range(value: str) -> Finding:
    if not value:
        return Finding(Level.OK, "discovery looks at this machine and its subnet, as by default")
    unknown = Finding(
        Level.NOTE,
        f"{_RANGE} is {value}, which ROS does not know and takes for LOCALHOST",
        f"write one of {', '.join(_RANGES)}",
    )
    return _RANGES.get(value, unknown)
