"""One ROS context per domain and process, shared by all who need one.

A context is a DDS participant: eleven threads, and every other participant of the network keeps a
record of it. So a gateway with two sources, or a test with ten announcers, has one. It is made
without ROS's signal handlers (they would shut it down behind our back), without its log files, and
without a look at this program's command line.
"""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import attrs
from rclpy.context import Context
from rclpy.node import Node

from beacon_core.errors import ConfigError, UsageError
from beacon_ros.ending import deafen
from beacon_ros.environment import MAX_DOMAIN

__all__ = ["NO_FORK", "OwnNode"]

NO_FORK = "ROS does not work in a forked child; start the child with multiprocessing's spawn"
"""Seen: a child of a process that had used ROS was heard by nobody, without any error."""


class OwnNode:
    """A node of ours in the shared context. Thread rule: any thread; ``close`` is idempotent.

    Its name begins with ``_``, which hides it in ROS's tools, as other infrastructure does, and
    tells other gateways that there is nothing to ask here.
    """

    def __init__(
        self, role: str, domain_id: int | None, *, parameter_services: bool = False
    ) -> None:
        """``domain_id`` ``None``: that of the environment (ROS_DOMAIN_ID).

        Raises ``ConfigError`` for a domain or an environment that ROS refuses, and ``UsageError``
        in a child that was forked after the first of these was made.
        """
        self._shared = _acquire(domain_id)
        self.context = self._shared.context
        try:
            self.node = Node(
                f"_beacon_{role}_{os.getpid()}_{next(_numbers)}",
                context=self.context,
                use_global_arguments=False,
                enable_rosout=False,
                start_parameter_services=parameter_services,
            )
        except Exception as error:  # RCLError, which is not a public name
            with _released(self._shared):
                pass
            raise _refused(error) from error
        self._lock = threading.Lock()
        self._closed = False

    def close(self) -> None:
        """Destroy the node, and the context with the last of its nodes. Whatever runs on the node
        must have ended."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        with _released(self._shared) as last:
            if last:
                deafen(self.node)
            self.node.destroy_node()


@attrs.define(eq=False)
class _Shared:
    context: Context
    key: int | str
    users: int = 0
    ending: threading.Lock = attrs.field(factory=threading.Lock)
    """Held while a node is destroyed: the context ends after all of them."""


_numbers: Iterator[int] = itertools.count(1)
_lock = threading.Lock()
_contexts: dict[int | str, _Shared] = {}
"""By the domain's number, or what the environment said instead."""
_used_by: set[int] = set()


def _acquire(domain_id: int | None) -> _Shared:
    if _used_by - {os.getpid()}:
        raise UsageError(NO_FORK)
    key = os.environ.get("ROS_DOMAIN_ID", "") if domain_id is None else domain_id
    with _lock:
        shared = _contexts.get(key)
        if shared is None or not shared.context.ok():
            shared = _contexts[key] = _Shared(_new_context(domain_id), key)
        _used_by.add(os.getpid())
        shared.users += 1
        return shared


@contextmanager
def _released(shared: _Shared) -> Iterator[bool]:
    """Use it no more from now on, and end the context after the last use; says if this is it."""
    with shared.ending:
        with _lock:
            shared.users -= 1
            last = not shared.users
            if last and _contexts.get(shared.key) is shared:
                del _contexts[shared.key]
        try:
            yield last
        finally:
            if last:
                shared.context.try_shutdown()
                shared.context.destroy()


def _new_context(domain_id: int | None) -> Context:
    context = Context()
    try:
        context.init(args=[], initialize_logging=False, domain_id=domain_id)
    except Exception as error:  # RCLError, which is not a public name
        raise _refused(error) from error
    # Fast DDS ends the whole process for such a domain.
    if (found := context.get_domain_id()) > MAX_DOMAIN:
        named = "ROS_DOMAIN_ID" if domain_id is None else "domain_id"
        raise ConfigError(f"{named}: {found} is no domain; write 0 to {MAX_DOMAIN}")
    return context


def _refused(error: Exception) -> ConfigError:
    return ConfigError(f"ROS refuses to begin: {' '.join(str(error).split())}")
