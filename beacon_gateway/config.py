"""The gateway's configuration: a YAML document into frozen values, or everything wrong with it.

The reference for people is docs/configuration.md; the same keys in the same order.
"""

from __future__ import annotations

import enum
import re
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import attrs

from beacon_core.errors import ConfigError
from beacon_core.limits import MAX_HINTS
from beacon_core.ports.adapter import Adapter
from beacon_core.skew import SkewPolicy
from beacon_gateway.access.options import AuthConfig, CorsConfig, RateLimitConfig, TlsConfig
from beacon_gateway.adapters import load_adapter
from beacon_gateway.documents import read_yaml
from beacon_gateway.ids import an_id, an_id_or_empty, ids, named
from beacon_gateway.problems import DocumentError, Problem, headed
from beacon_gateway.relay.config import RelayConfig
from beacon_gateway.relay.config import register as register_relay
from beacon_gateway.snapshot import SnapshotConfig
from beacon_gateway.structuring import Structurer
from beacon_gateway.tree import entities as tree
from beacon_gateway.tree.manifest import Manifest, load_manifest

__all__ = [
    "DEFAULT_SOURCES",
    "AppEntry",
    "AreaEntry",
    "ComponentEntry",
    "Config",
    "DefaultComponent",
    "EntitiesConfig",
    "FunctionEntry",
    "HttpConfig",
    "Loaded",
    "LogFormat",
    "LogLevel",
    "Lookup",
    "SourceConfig",
    "a_port",
    "default_config",
    "load_config",
    "parse_config",
    "read_manifest",
]

DEFAULT_SOURCES: Mapping[str, object] = {
    "zenoh": {"adapter": "zenoh", "options": {"mode": "router", "listen": ["tcp/127.0.0.1:7447"]}}
}
"""Where nothing is configured: the gateway is its own Zenoh router, for this machine only."""


_NODE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


class _Entry(Protocol):
    @property
    def id(self) -> str: ...


class LogLevel(enum.StrEnum):
    """How grave a message must be to be logged."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class LogFormat(enum.StrEnum):
    """How a log line is written."""

    TEXT = "text"
    JSON = "json"
    """One object per line."""


def a_port(_: object, __: object, value: int) -> None:
    """An attrs validator."""
    if not 0 <= value <= 65535:
        raise ValueError(f"found the number {value}; give a port, 0 to 65535 (0: any free one)")


def _node_or_empty(_: object, __: object, value: str) -> None:
    if value and not _NODE.fullmatch(value):
        raise ValueError(f"found {ascii(value)[:60]}; give a node's full name, such as /arm/driver")


def _unlike(_: object, __: object, value: tuple[_Entry, ...]) -> None:
    twice = [entry_id for entry_id, count in Counter(e.id for e in value).items() if count > 1]
    if twice:
        raise ValueError(f"given more than once: {', '.join(twice)}; give each id once")


@attrs.frozen
class HttpConfig:
    """Where the gateway serves."""

    host: str = "127.0.0.1"
    port: int = attrs.field(default=8080, validator=a_port)
    max_streams: int = attrs.field(default=2000, metadata={"at_least": 1})
    metrics_per_entity: bool = False
    """``/metrics`` also has a series for each entity."""
    allow_insecure: bool = False
    """Serve on other than the loopback although TLS or authentication is missing."""
    tls: TlsConfig | None = None
    auth: AuthConfig | None = None
    cors: CorsConfig = attrs.field(factory=CorsConfig)
    rate_limit: RateLimitConfig = attrs.field(factory=RateLimitConfig)
    max_body_bytes: int = attrs.field(default=65_536, metadata={"at_least": 1024})

    def located(self, folder: Path) -> HttpConfig:
        """The same with paths that begin in ``folder``."""
        auth = self.auth and self.auth.located(folder)
        return attrs.evolve(self, tls=self.tls and self.tls.located(folder), auth=auth)


@attrs.frozen
class SourceConfig:
    """One carrier to listen on, with a store of its own."""

    adapter: str = attrs.field(metadata={"right": "the name of an installed adapter"})
    ttl_s: float = attrs.field(default=10.0, metadata={"at_least": 0.1})
    expiry_s: float = attrs.field(default=300.0, metadata={"at_least": 1.0})
    max_hints: int = attrs.field(default=MAX_HINTS, metadata={"at_least": 1})
    source_rate: float = attrs.field(default=100.0, metadata={"at_least": 1.0})
    global_rate: float = attrs.field(default=10_000.0, metadata={"at_least": 1.0})
    skew_policy: SkewPolicy = SkewPolicy.AUTO
    options: Any = None
    """An instance of the adapter's own options class."""


@attrs.frozen
class AreaEntry:
    """A part of the machine or of the plant that is known beforehand."""

    id: str = attrs.field(validator=an_id, metadata={"right": "an id"})
    name: str = ""


@attrs.frozen
class ComponentEntry:
    """A computer, a controller or a device that is known beforehand."""

    id: str = attrs.field(validator=an_id, metadata={"right": "an id"})
    name: str = ""


@attrs.frozen
class AppEntry:
    """An app that is listed whether or not it is ever heard; ``component_id`` is its host, and
    ``ros_node`` the full name of its ROS node."""

    id: str = attrs.field(validator=an_id, metadata={"right": "an id"})
    name: str = ""
    component_id: str = attrs.field(default="", validator=an_id_or_empty)
    ros_node: str = attrs.field(default="", validator=_node_or_empty)


@attrs.frozen
class FunctionEntry:
    """Something the machine can do; ``hosts`` are the ids that take part whatever hints say."""

    id: str = attrs.field(validator=an_id, metadata={"right": "an id"})
    name: str = ""
    hosts: tuple[str, ...] = attrs.field(default=(), validator=ids)


@attrs.frozen
class EntitiesConfig:
    """The tree as it is known beforehand."""

    areas: tuple[AreaEntry, ...] = attrs.field(default=(), validator=_unlike)
    components: tuple[ComponentEntry, ...] = attrs.field(default=(), validator=_unlike)
    apps: tuple[AppEntry, ...] = attrs.field(default=(), validator=_unlike)
    functions: tuple[FunctionEntry, ...] = attrs.field(default=(), validator=_unlike)

    def tree(self) -> tree.Tree:
        """The same as the gateway's tree."""
        return tree.Tree(
            areas={one.id: tree.Area(one.id, one.name) for one in self.areas},
            components={one.id: tree.Component(one.id, one.name) for one in self.components},
            apps={one.id: _app(one) for one in self.apps},
            functions={
                one.id: tree.Function(one.id, one.name, one.hosts) for one in self.functions
            },
        )


def _app(entry: AppEntry) -> tree.App:
    node = entry.ros_node.removeprefix("/")
    binding = tree.RosBinding(node) if node else None
    return tree.App(entry.id, entry.name, entry.component_id, ros_binding=binding)


@attrs.frozen
class DefaultComponent:
    """Where apps are listed that nobody places."""

    id: str = attrs.field(default="", validator=an_id_or_empty)
    name: str = ""
    area: str = attrs.field(default="unplaced", validator=an_id)


@attrs.frozen
class Config:
    """Everything that can be configured."""

    http: HttpConfig = HttpConfig()
    sources: Mapping[str, SourceConfig] = attrs.field(
        validator=named(
            "a source", "found no source; give at least one, or leave the key out for the default"
        ),
        kw_only=True,
        metadata={"right": "sources by name, such as {robots: {adapter: zenoh}}"},
    )
    entities: EntitiesConfig = EntitiesConfig()
    manifest: str = ""
    strict_manifest: bool = False
    strict_upstream_merge: bool = False
    runtime_nodes: bool = False
    default_component: DefaultComponent = DefaultComponent()
    allow_new_entities: bool = True
    snapshot: SnapshotConfig | None = None
    relay: RelayConfig | None = None
    server_name: str = "Beacon gateway"
    server_version: str = ""
    """Empty: the gateway's own."""
    vendor_name: str = "beacon"
    log_level: LogLevel = LogLevel.INFO
    log_format: LogFormat = LogFormat.TEXT


@attrs.frozen
class Loaded:
    """A configuration, and what had to be corrected in it."""

    config: Config
    corrections: tuple[Problem, ...] = ()


Lookup = Callable[[str], Adapter]
"""Gives the adapter of a name, or raises ``ConfigError``."""


def default_config(lookup: Lookup = load_adapter) -> Loaded:
    """The embedded default: no file needed."""
    return parse_config({}, lookup)


def load_config(path: Path, lookup: Lookup = load_adapter) -> Loaded:
    """Read a file. Raises ``ConfigError``: every problem at once, one per line."""
    return parse_config(read_yaml(path), lookup, folder=path.parent)


def parse_config(
    document: object, lookup: Lookup = load_adapter, *, folder: Path | None = None
) -> Loaded:
    """Structure what a file holds; an empty one gives the default. Raises as ``load_config``.

    ``folder``: where the path of a manifest begins; without, where the process is.
    """
    structurer = Structurer()
    register_relay(structurer)
    structurer.hook(SourceConfig, lambda value: _source(value, structurer, lookup))
    structurer.hook(Config, lambda value: _config(value, structurer, folder))
    config = structurer.structure({} if document is None else document, Config)
    return Loaded(config, tuple(structurer.corrections))


def read_manifest(config: Config) -> Manifest:
    """All that is known beforehand: the manifest's file, and ``entities`` beside it.

    Raises ``ConfigError`` as ``load_config`` does, which has read it before; it may have changed.
    """
    given = config.entities.tree()
    if not config.manifest:
        return Manifest(given)
    path = Path(config.manifest)
    try:
        written = load_manifest(path, strict=config.strict_manifest)
    except ConfigError as error:
        raise headed(str(path), error) from error
    twice = _ids_of(given) & _ids_of(written.tree)
    if twice:
        named = ", ".join(sorted(twice))
        raise ConfigError(f"{named}: in {path} too; give each id once")
    return attrs.evolve(written, tree=_both(written.tree, given))


def _both(one: tree.Tree, other: tree.Tree) -> tree.Tree:
    return tree.Tree(
        {**one.areas, **other.areas},
        {**one.components, **other.components},
        {**one.apps, **other.apps},
        {**one.functions, **other.functions},
    )


def _ids_of(given: tree.Tree) -> set[str]:
    return {*given.areas, *given.components, *given.apps, *given.functions}


def _config(value: object, structurer: Structurer, folder: Path | None) -> Config:
    given = dict(structurer.mapping(value))
    path = given.get("manifest")
    if isinstance(path, str) and path:
        given["manifest"] = str((folder or Path()) / path)
        with structurer.at(".manifest"):
            strict = given.get("strict_manifest") is True
            _check_manifest(Path(given["manifest"]), structurer, strict=strict)
    config = structurer.fields({"sources": DEFAULT_SOURCES, **given}, Config)
    if config.manifest and not structurer.problems:
        _check_ids(config, structurer)
    folder = folder or Path()
    snapshot = config.snapshot and attrs.evolve(config.snapshot, path=folder / config.snapshot.path)
    relay = config.relay
    if relay is not None:
        relay = attrs.evolve(relay, identity=relay.identity or str(folder.resolve()))
    return attrs.evolve(config, http=config.http.located(folder), snapshot=snapshot, relay=relay)


def _check_ids(config: Config, structurer: Structurer) -> None:
    with structurer.at(".entities"):
        read_manifest(config)


def _check_manifest(path: Path, structurer: Structurer, *, strict: bool) -> None:
    try:
        doubts = load_manifest(path, strict=strict).warnings
    except DocumentError as error:
        for problem in error.problems:
            structurer.note(f"{path}: {problem}")
    else:
        for doubt in doubts:
            structurer.correct(f"{path}: {doubt}")


def _source(value: object, structurer: Structurer, lookup: Lookup) -> SourceConfig:
    given = {} if value is None else dict(structurer.mapping(value))
    options = given.pop("options", None)
    adapter = _adapter(given.get("adapter"), structurer, lookup)
    if adapter is not None:
        given = {"ttl_s": adapter.default_ttl_s, **given}
        with structurer.at(".options"):
            given["options"] = structurer.part(options, adapter.options)
    source = _outliving_its_interval(structurer.fields(given, SourceConfig), structurer)
    if source.expiry_s > source.ttl_s:
        return source
    with structurer.at(".expiry_s"):
        structurer.correct(
            f"{source.expiry_s} is not above ttl_s ({source.ttl_s}); using {10 * source.ttl_s}"
        )
    return attrs.evolve(source, expiry_s=10 * source.ttl_s)


def _outliving_its_interval(source: SourceConfig, structurer: Structurer) -> SourceConfig:
    """A hint that is asked for must live until the next time: longer than each option, in seconds,
    that its field says so of (``metadata={"ttl_above": True}``)."""
    fields = attrs.fields(type(source.options)) if attrs.has(type(source.options)) else ()
    intervals = [field.name for field in fields if field.metadata.get("ttl_above")]
    for name in intervals:
        interval_s = getattr(source.options, name)
        if source.ttl_s <= interval_s:
            with structurer.at(".ttl_s"):
                structurer.correct(
                    f"{source.ttl_s} is not above {name} ({interval_s}); using {3 * interval_s}"
                )
            source = attrs.evolve(source, ttl_s=3 * interval_s)
    return source


def _adapter(name: object, structurer: Structurer, lookup: Lookup) -> Adapter | None:
    with structurer.at(".adapter"):
        return lookup(name) if isinstance(name, str) else None
    return None
