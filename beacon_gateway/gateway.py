"""The gateway at work: all configured sources, kept tidy, and one directory over them."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterable

from beacon_core.clock import Clock, SystemClock
from beacon_core.limits import MAX_HINTS
from beacon_gateway.adapters import load_adapter
from beacon_gateway.config import Config, Lookup, read_manifest
from beacon_gateway.departures import Departures
from beacon_gateway.directory import Directory
from beacon_gateway.listener import Listener
from beacon_gateway.relay.relay import Relay
from beacon_gateway.snapshot import Snapshots
from beacon_gateway.tree.host import Host
from beacon_gateway.tree.keeper import TreeSettings
from beacon_gateway.tree.linker import whom_to_ask
from beacon_gateway.tree.manifest import Manifest
from beacon_gateway.vendor import vendor_endpoints

__all__ = ["Gateway"]

_log = logging.getLogger(__name__)

_CLOSE_WITHIN_S = 2.0
"""Adapters promise one second; they close side by side."""

_WRITE_WITHIN_S = 2.0
"""A full snapshot takes a tenth of that; a disk that hangs must not hold up the end."""


_SWEEPER_LATE_S = 10.0
"""A busy machine may hold a thread up for a second or two; ten are a defect."""


class Gateway:
    """Embeds the core: one listener per configured source, and a sweeper for their stores.

    Thread rule: ``start`` once, from one thread; everything else from any.
    """

    def __init__(
        self, config: Config, *, lookup: Lookup = load_adapter, clock: Clock | None = None
    ) -> None:
        """Opens nothing. Raises ``ConfigError`` for a source that cannot be made or served."""
        self.config = config
        self.clock: Clock = SystemClock() if clock is None else clock
        self.started_ns = self.clock.monotonic_ns()
        self.stopping = threading.Event()
        """Set when answers that have no end of their own must end: the streams."""
        adapters = {name: lookup(source.adapter) for name, source in config.sources.items()}
        self.vendor_endpoints = vendor_endpoints(adapters)
        """Beside ours: each with the names of the adapters whose view is served there."""
        manifest = read_manifest(config)
        self._targets = whom_to_ask(manifest.tree.apps.values(), {})
        departures = Departures(MAX_HINTS if len(config.sources) > 1 else 0)
        self.listeners = tuple(
            Listener(
                name,
                source,
                adapters[name],
                self.clock,
                departures=departures,
                targets=self._targets,
            )
            for name, source in config.sources.items()
        )
        self.directory = Directory(manifest, self.listeners, departures, _tree_settings(config))
        self._snapshots: Snapshots | None = None
        if config.snapshot is not None:
            stores = {listener.name: listener.store for listener in self.listeners}
            self._snapshots = Snapshots(config.snapshot, stores, self.clock)
        self.relay = Relay(config.relay, clock=self.clock) if config.relay is not None else None
        self._retargeting = threading.Lock()
        self._closing = threading.Event()
        self._swept_s = 0.0
        self._sweeper = threading.Thread(target=self._sweep, name="beacon-sweeper", daemon=True)

    def start(self) -> None:
        """Begin to listen on every source, and to relay at every end, or on and at none.

        Raises ``ConfigError`` for what no amount of trying can mend.
        """
        if self._snapshots is not None:
            self._snapshots.restore()
        try:
            for listener in self.listeners:
                listener.start()
            if self.relay is not None:
                self.relay.start()
        except BaseException:
            self.close()
            raise
        self._swept_s = time.monotonic()
        self._sweeper.start()
        if self._snapshots is not None:
            self._snapshots.start()

    @property
    def running(self) -> bool:
        """Every source has been started, and none is closed."""
        return self._sweeper.ident is not None and not self._closing.is_set()

    @property
    def sweeping(self) -> bool:
        """The sweeper is alive, and not late by more than ``10 s``."""
        longest_s = min(listener.store.ttl_ns for listener in self.listeners) / 1e9
        late_s = time.monotonic() - self._swept_s - longest_s
        return self._sweeper.is_alive() and late_s < _SWEEPER_LATE_S

    def take_config(self, config: Config, manifest: Manifest) -> None:
        """Put another configuration in the place of the one there is. Its sources must be the
        same; ``manifest`` is :func:`beacon_gateway.config.read_manifest` of it.
        """
        self.config = config
        self.directory.take_manifest(manifest)
        self._retarget()

    def close(self) -> None:
        """Stop listening. Idempotent, within 2 s whatever an adapter does, and 2 s more whatever
        the disk does; what was heard stays readable."""
        self.stopping.set()
        self._closing.set()
        relays = [] if self.relay is None else [self.relay]
        threads = [
            threading.Thread(target=_close, args=(one,), daemon=True)
            for one in (*self.listeners, *relays)
        ]
        for thread in threads:
            thread.start()
        if self._sweeper.is_alive():
            threads.append(self._sweeper)
        _join(threads)
        if self._snapshots is not None:
            self._snapshots.close(_WRITE_WITHIN_S)

    def _sweep(self) -> None:
        """Settle each store when something in it falls due.

        A hint that arrives while this sleeps falls due a ttl later at the earliest, so sleeping for
        the shortest ttl at most misses nothing.
        """
        stores = [listener.store for listener in self.listeners]
        longest_ns = min(store.ttl_ns for store in stores)
        while True:
            deadlines = [store.next_deadline_ns() for store in stores]
            now_ns = self.clock.monotonic_ns()
            due_ns = min((at for at in deadlines if at is not None), default=now_ns + longest_ns)
            wait_ns = min(max(due_ns - now_ns, 0), longest_ns)
            if self._closing.wait(max(wait_ns / 1e9, 0.001)):
                return
            for store in stores:
                store.sweep()
            self.directory.listen()
            self._retarget()
            self._swept_s = time.monotonic()

    def _retarget(self) -> None:
        """Tell the sources that ask if they are to ask others: the apps' nodes may have been found
        in the ROS graph, or the apps may be others."""
        asking = [listener for listener in self.listeners if listener.asks]
        if not asking:
            return
        with self._retargeting:
            before, self._targets = self._targets, self.directory.whom_to_ask()
            if self._targets != before:
                for listener in asking:
                    listener.take_targets(self._targets)


def _tree_settings(config: Config) -> TreeSettings:
    default = config.default_component
    return TreeSettings(
        host=Host.named(default.id, default.name, default.area),
        allow_new_entities=config.allow_new_entities,
        strict_upstream_merge=config.strict_upstream_merge,
        runtime_nodes=config.runtime_nodes,
    )


def _close(one: Listener | Relay) -> None:
    try:
        one.close()
    except Exception:  # noqa: BLE001 - a faulty adapter must not keep the others open
        name = f"the source {one.name}" if isinstance(one, Listener) else "the relay"
        _log.exception("closing %s failed", name)


def _join(threads: Iterable[threading.Thread]) -> None:
    deadline_s = time.monotonic() + _CLOSE_WITHIN_S
    for thread in threads:
        thread.join(max(0.0, deadline_s - time.monotonic()))
