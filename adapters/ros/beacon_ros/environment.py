"""Which ROS there is, and one clear sentence where it is not enough."""

from __future__ import annotations

import os
from importlib.metadata import PackageNotFoundError, version

from beacon_core.errors import ConfigError

__all__ = ["MAX_DOMAIN", "RAW_RMW", "distribution", "need_rclpy", "why_no_raw_types"]

MAX_DOMAIN = 232
"""Above, the ports that DDS computes from the domain do not exist."""

RAW_RMW = "rmw_fastrtps_cpp"
"""The middleware whose type support is built at run time here; the default of ROS 2 Jazzy."""

_RAW_DISTRIBUTION = "jazzy"
_RCLPY = {"7.1": "jazzy", "3.3": "humble", "9.1": "kilted"}
"""rclpy's version in each distribution (its package.xml); wheels set no ROS_DISTRO."""


def need_rclpy(adapter: str) -> None:
    """Raises ``ConfigError`` with what to do if rclpy cannot be imported."""
    try:
        import rclpy  # noqa: F401, PLC0415 - to see whether it is there
    except ImportError as error:
        raise ConfigError(
            f"adapter: {adapter!r} needs rclpy ({error}); source a ROS 2 installation, "
            "or run: pip install 'beacon-core[ros]'"
        ) from error


def distribution() -> str:
    """The name of the ROS 2 distribution, such as ``jazzy``; ``""`` if it cannot be told."""
    named = os.environ.get("ROS_DISTRO", "")
    if named:
        return named
    try:
        return _RCLPY.get(".".join(version("rclpy").split(".")[:2]), "")
    except PackageNotFoundError:
        return ""


def why_no_raw_types() -> str:
    """Why a message type cannot be made at run time here; ``""`` if it can. Needs rclpy."""
    from rclpy.utilities import get_rmw_implementation_identifier  # noqa: PLC0415 - needs rclpy

    rmw, distro = get_rmw_implementation_identifier(), distribution()
    if rmw == RAW_RMW and distro == _RAW_DISTRIBUTION:
        return ""
    found = f"{rmw} of {f'ROS 2 {distro}' if distro else 'an unknown ROS 2 distribution'}"
    return (
        f"a message type can be made at run time for {RAW_RMW} of ROS 2 {_RAW_DISTRIBUTION} only, "
        f"and here is {found}; install the package ros2_medkit_msgs"
    )
