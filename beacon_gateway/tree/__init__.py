"""The entity tree: what the manifest, the ROS graph and the beacons say of it, merged into one."""

from __future__ import annotations
